//! The `mock_driver` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    puffer_shell::main(mock_driver::run)
}
