//! What the shell asks of interface types.

use puffer_core::params::{ParamSpec, Parameters};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// A message type.
pub trait Message: Serialize + DeserializeOwned + Clone + Send + Sync + 'static {
    /// Such as "sensor_msgs/msg/PointCloud2".
    const TYPE: &'static str;
}

/// A service type.
pub trait Service: 'static {
    /// The request.
    type Request: Serialize + DeserializeOwned + Clone + Send + Sync + 'static;
    /// The response.
    type Response: Serialize + DeserializeOwned + Clone + Send + Sync + 'static;
    /// Such as "std_srvs/srv/Trigger".
    const TYPE: &'static str;
}

/// An action type.
pub trait Action: 'static {
    /// The goal.
    type Goal: Serialize + DeserializeOwned + Clone + Send + Sync + 'static;
    /// The result.
    type Result: Serialize + DeserializeOwned + Clone + Default + Send + Sync + 'static;
    /// The feedback.
    type Feedback: Serialize + DeserializeOwned + Clone + Send + Sync + 'static;
    /// Such as "puffer_msgs/action/ModelObject".
    const TYPE: &'static str;
}

/// The parameters of a node that has none of its own.
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
