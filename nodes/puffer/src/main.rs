//! The `puffer` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    puffer::run(std::env::args_os())
}
