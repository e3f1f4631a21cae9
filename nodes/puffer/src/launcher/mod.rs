//! Starts and stops nodes together: each as a process of its own, or all as tasks of this process.

mod config;
mod processes;
mod tasks;

pub(crate) use config::LaunchConfig;

use anyhow::Result;
use processes::NodeProcesses;
use tasks::NodeTasks;

/// Nodes that were started. Dropping it ends them at once.
pub(crate) enum RunningNodes {
    Processes(NodeProcesses),
    Tasks(NodeTasks),
}

impl RunningNodes {
    /// Starts the nodes, in this process if `one_process`.
    ///
    /// # Errors
    /// One cannot be started.
    pub(crate) fn start(config: &LaunchConfig, one_process: bool) -> Result<RunningNodes> {
        Ok(if one_process {
            RunningNodes::Tasks(NodeTasks::start(config)?)
        } else {
            RunningNodes::Processes(NodeProcesses::start(config)?)
        })
    }

    /// Name and process ID of each node.
    pub(crate) fn process_ids(&self) -> Vec<(String, u32)> {
        match self {
            RunningNodes::Processes(processes) => processes.process_ids(),
            RunningNodes::Tasks(tasks) => {
                tasks.names().into_iter().map(|name| (name, std::process::id())).collect()
            }
        }
    }

    /// Waits until a node ends by itself; the reason.
    pub(crate) async fn wait_for_exit(&mut self) -> String {
        match self {
            RunningNodes::Processes(processes) => processes.wait_for_exit().await,
            RunningNodes::Tasks(tasks) => tasks.wait_for_exit().await,
        }
    }

    /// Asks all nodes to end and waits for them; those that do not are killed. Returns what went
    /// wrong.
    pub(crate) async fn stop(self) -> Vec<String> {
        match self {
            RunningNodes::Processes(processes) => processes.stop().await,
            RunningNodes::Tasks(tasks) => tasks.stop().await,
        }
    }
}
