//! The `nbv_planner` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    puffer_ros::main(nbv_planner::run)
}
