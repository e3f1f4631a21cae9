//! The `scan_registrar` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    puffer_shell::main(scan_registrar::run)
}
