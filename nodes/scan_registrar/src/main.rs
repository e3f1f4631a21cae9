//! The `scan_registrar` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    puffer_ros::main(scan_registrar::run)
}
