//! `puffer node`: this program as one of the nodes.

use crate::exit_status::usage_error;
use crate::nodes::{NODES, find_node};
use anyhow::Result;
use clap::Args;
use puffer_ros::{RosArgs, Stop};
use std::io::Read;
use std::process::ExitCode;

/// Runs one node, as its own program does.
#[derive(Args)]
pub struct NodeCommand {
    /// End when standard input is closed
    #[arg(long, hide = true)]
    with_parent: bool,
    /// mock_driver, scan_registrar, nbv_planner, cloud_filter, mesh_reconstructor or modeller
    #[arg(value_name = "NAME")]
    name: String,
    /// --ros-args and what follows, as every ROS 2 node takes them
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGS")]
    args: Vec<String>,
}

impl NodeCommand {
    pub(super) fn run(&self) -> Result<ExitCode> {
        let Some(node) = find_node(&self.name) else {
            let names: Vec<&str> = NODES.iter().map(|kind| kind.name).collect();
            return Err(usage_error(format!(
                "there is no node {}; there are {}",
                self.name,
                names.join(", ")
            )));
        };
        let run = async |args: RosArgs, stop: Stop| {
            if self.with_parent {
                stop_with_input(stop.clone());
            }
            (node.run)(args, stop).await
        };
        Ok(puffer_ros::main_with(self.args.iter().cloned(), run))
    }
}

/// Stops the node when standard input comes to its end: whoever started it is gone.
fn stop_with_input(stop: Stop) {
    // A thread of its own: nothing waits for a read that never ends.
    std::thread::spawn(move || {
        let mut bytes = [0; 64];
        while matches!(std::io::stdin().read(&mut bytes), Ok(1..)) {}
        stop.stop();
    });
}
