//! The program as its users call it. All tests are modules of one test program, because each test
//! program links everything that `puffer` links.

// The lints spare test functions only, not their helpers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;
mod faults;
mod goals;
mod launch_files;
mod parameters;
mod pipeline;
mod replay;
mod verdict;
mod wrong_input;
