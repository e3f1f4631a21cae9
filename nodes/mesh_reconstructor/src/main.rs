//! The `mesh_reconstructor` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    puffer_shell::main(mesh_reconstructor::run)
}
