//! The node that makes a watertight mesh of the filtered cloud.
//!
//! It subscribes to `filtered_cloud`. On `~/reconstruct` (for scripts) or `~/reconstruct_action`
//! (with progress) it makes a mesh, writes it, and publishes `model_mesh` and `model_marker`
//! (latched). It also takes scan folders, bags and clouds from files.

mod marker;
mod output_path;
mod params;
mod reconstruction;
mod services;

pub use params::{MeshParams, Params};

use anyhow::Result;
use puffer_core::geometry::Cloud;
use puffer_core::pipeline::cloud_hash;
use puffer_msgs::sensor_msgs::msg::PointCloud2;
use puffer_ros::conversions::cloud_from_message;
use puffer_ros::large_data::{Delivery, LargeDataSubscription};
use puffer_ros::{Node, RosArgs, Shared, Stop};
use reconstruction::Model;
use std::sync::Arc;

/// The state of the node.
#[derive(Default)]
pub(crate) struct ReconstructorState {
    /// The newest filtered cloud, with its hash.
    pub cloud: Option<(Arc<Cloud>, String)>,
    /// The newest mesh, written or not.
    pub model: Option<Arc<Model>>,
}

/// Runs the reconstructor until `stop`.
///
/// # Errors
/// Parameters that do not fit, or no network.
pub async fn run(args: RosArgs, stop: Stop) -> Result<()> {
    let node: Node<Params> = Node::start("mesh_reconstructor", args, stop.clone()).await?;
    let clouds: LargeDataSubscription<PointCloud2> =
        node.large_data_subscribe_from_any_writer("filtered_cloud", Delivery::Newest)?;
    let state = Shared::new(ReconstructorState::default());
    services::serve(&node, &state)?;
    tracing::info!("ready");
    loop {
        let cloud = match stop.or(clouds.next()).await {
            None => return Ok(()),
            Some(Ok(message)) => cloud_from_message(&message),
            Some(Err(error)) => Err(error.to_string()),
        };
        match cloud {
            Ok(cloud) => {
                let hash = cloud_hash(&cloud);
                node.diagnostics().set("points of the cloud", cloud.len());
                state.lock().await.cloud = Some((Arc::new(cloud), hash));
            }
            Err(reason) => tracing::warn!("a cloud is left out: {reason}"),
        }
    }
}
