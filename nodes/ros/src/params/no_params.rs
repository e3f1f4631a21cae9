//! The parameters of a node without parameters.

use puffer_core::params::{ParamSpec, Parameters};
use serde_json::Value;

/// The parameters of a node that has none of its own, except `use_sim_time`, which every node has.
///
/// ```no_run
/// # use puffer_ros::{NoParams, Node, RosArgs, Stop};
/// # async fn run(args: RosArgs, stop: Stop) -> anyhow::Result<()> {
/// let node = Node::<NoParams>::start("listener", args, stop).await?;
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NoParams;

impl Parameters for NoParams {
    fn all_specs() -> Vec<ParamSpec> {
        Vec::new()
    }
    fn set_named(&mut self, group: &str, field: &str, _: &Value) -> puffer_core::Result<()> {
        Err(puffer_core::Error::Parameter {
            name: format!("{group}.{field}"),
            message: "unknown; this node has no parameters of its own".to_owned(),
        })
    }
    fn all_values(&self) -> Vec<(String, Value)> {
        Vec::new()
    }
}
