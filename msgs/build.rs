//! Makes Rust types from the interface files.

fn main() {}
