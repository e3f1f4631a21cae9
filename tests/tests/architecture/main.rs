//! The rules of the house, which hold for every file: what may depend on what, and how code is
//! laid out. Each rule comes with a planted violation that its check must find.

// The lints spare test functions only, not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

mod circles;
mod dependencies;
mod layers;
mod layout;
mod source;
