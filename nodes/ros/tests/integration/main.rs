//! Nodes over real DDS. All tests are modules of one test program, because each test program links
//! everything that this crate links; `lengths` is one of its own, because it runs itself on hosts
//! of its own.

// The lints spare test functions only, not their helpers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod actions;
mod bags;
#[path = "../common/mod.rs"]
mod common;
mod foreign;
mod large_data;
mod services;
mod topics;
