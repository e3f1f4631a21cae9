//! The `modeller` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    puffer_ros::main(modeller::run)
}
