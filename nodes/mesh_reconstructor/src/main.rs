//! The `mesh_reconstructor` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    puffer_ros::main(mesh_reconstructor::run)
}
