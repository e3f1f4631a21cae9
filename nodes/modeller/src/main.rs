//! The `modeller` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    puffer_shell::main(modeller::run)
}
