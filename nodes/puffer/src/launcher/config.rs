//! What nodes are started with.

use crate::nodes::NodeKind;
use std::path::PathBuf;

/// What nodes are started with.
#[derive(Clone)]
pub(crate) struct LaunchConfig {
    pub nodes: Vec<&'static NodeKind>,
    pub domain: u16,
    /// ROS parameter file.
    pub params: PathBuf,
    /// Further ROS arguments, which override the file.
    pub more_args: Vec<String>,
    /// File that the nodes' output is appended to; `None`: it goes to the terminal.
    pub log: Option<PathBuf>,
}
