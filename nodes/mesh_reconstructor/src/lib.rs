//! Filtered cloud to a watertight mesh.
//!
//! Takes `filtered_cloud`; makes a mesh on `~/reconstruct` (for scripts) or `~/reconstruct_action` (with progress),
//! writes it and publishes `model_mesh` and `model_marker` (latched). Also takes scan folders, bags and clouds from files.

mod marker;
mod params;
mod paths;
mod serve;
mod work;

pub use params::{MeshParams, Params};

use anyhow::Result;
use puffer_core::geometry::Cloud;
use puffer_core::pipeline::cloud_hash;
use puffer_msgs::sensor_msgs::msg::PointCloud2;
use puffer_shell::bulk::{BulkSubscription, Delivery};
use puffer_shell::convert::cloud_from_message;
use puffer_shell::{Node, RosArgs, Stop};
use std::sync::Arc;
use tokio::sync::Mutex;
use work::Model;

/// What the node holds.
#[derive(Default)]
pub(crate) struct Desk {
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
    let clouds: BulkSubscription<PointCloud2> =
        node.bulk_subscribe_from_all("filtered_cloud", Delivery::Newest)?;
    let desk = Arc::new(Mutex::new(Desk::default()));
    serve::all(&node, &desk)?;
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
                desk.lock().await.cloud = Some((Arc::new(cloud), hash));
            }
            Err(reason) => tracing::warn!("a cloud is left out: {reason}"),
        }
    }
}
