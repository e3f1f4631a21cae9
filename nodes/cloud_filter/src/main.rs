//! The `cloud_filter` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    puffer_ros::main(cloud_filter::run)
}
