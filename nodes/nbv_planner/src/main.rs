//! The `nbv_planner` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    puffer_shell::main(nbv_planner::run)
}
