//! The `mock_driver` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    puffer_ros::main(mock_driver::run)
}
