//! The nodes that this program can run as.

use anyhow::Result;
use puffer_core::params::{ParamSpec, Parameters};
use puffer_ros::{RosArgs, Stop};
use std::pin::Pin;

type NodeFuture = Pin<Box<dyn Future<Output = Result<()>> + Send>>;

/// A node: its name, its `run` and its parameters.
pub(crate) struct NodeKind {
    pub name: &'static str,
    pub run: fn(RosArgs, Stop) -> NodeFuture,
    pub specs: fn() -> Vec<ParamSpec>,
    /// Checks one parameter.
    pub check: fn(&str, &str, &serde_json::Value) -> puffer_core::Result<()>,
}

macro_rules! kinds {
    ($($module:ident),*) => {
        [$(NodeKind {
            name: stringify!($module),
            run: |args, stop| Box::pin($module::run(args, stop)),
            specs: <$module::Params as Parameters>::all_specs,
            check: |group, field, value| {
                <$module::Params as Default>::default().set_named(group, field, value)
            },
        }),*]
    };
}

/// All nodes, in the order in which they are started: those that listen before those that speak.
pub(crate) static NODES: [NodeKind; 6] =
    kinds![mesh_reconstructor, cloud_filter, nbv_planner, scan_registrar, modeller, mock_driver];

/// The node of that name.
pub(crate) fn find_node(name: &str) -> Option<&'static NodeKind> {
    NODES.iter().find(|kind| kind.name == name)
}
