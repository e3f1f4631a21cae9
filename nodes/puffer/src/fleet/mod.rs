//! Nodes started and stopped together: each a process of its own, or all tasks of this one.

mod processes;
mod tasks;

use crate::nodes::NodeKind;
use anyhow::Result;
use processes::Processes;
use std::path::PathBuf;
use tasks::Tasks;

/// What the nodes of a fleet are started with.
#[derive(Clone)]
pub(crate) struct Crew {
    pub nodes: Vec<&'static NodeKind>,
    pub domain: u16,
    /// ROS parameter file.
    pub params: PathBuf,
    /// ROS arguments behind it.
    pub more: Vec<String>,
    /// Where their lines go; none: to the terminal.
    pub log: Option<PathBuf>,
}

/// Running nodes. Dropping it stops them without grace.
pub(crate) enum Fleet {
    Processes(Processes),
    Tasks(Tasks),
}

impl Fleet {
    /// Starts the nodes, in this process if `one_process`.
    ///
    /// # Errors
    /// One cannot be started.
    pub(crate) fn start(crew: &Crew, one_process: bool) -> Result<Fleet> {
        Ok(if one_process {
            Fleet::Tasks(Tasks::start(crew)?)
        } else {
            Fleet::Processes(Processes::start(crew)?)
        })
    }

    /// Name and process of each node, for the user.
    pub(crate) fn roll(&self) -> Vec<(String, u32)> {
        match self {
            Fleet::Processes(processes) => processes.roll(),
            Fleet::Tasks(tasks) => {
                tasks.names().into_iter().map(|name| (name, std::process::id())).collect()
            }
        }
    }

    /// Resolves with the reason when a node has ended by itself.
    pub(crate) async fn loss(&mut self) -> String {
        match self {
            Fleet::Processes(processes) => processes.loss().await,
            Fleet::Tasks(tasks) => tasks.loss().await,
        }
    }

    /// Asks all to end, and waits; those that do not are killed. Returns what went wrong.
    pub(crate) async fn stop(self) -> Vec<String> {
        match self {
            Fleet::Processes(processes) => processes.stop().await,
            Fleet::Tasks(tasks) => tasks.stop().await,
        }
    }
}
