//! Registered scans to one filtered cloud.
//!
//! Holds `registered_scan` and follows `registered_poses`; on `~/filter` combines all accepted
//! scans to `filtered_cloud` (latched): x y z, normal, sigma, support.

mod scan_store;

use anyhow::Result;
use puffer_core::filter::FilterParams;
use puffer_core::pipeline::cloud_hash;
use puffer_msgs::msg::{RegisteredPoses, RegisteredScan};
use puffer_msgs::sensor_msgs::msg::PointCloud2;
use puffer_msgs::srv::{Filter, FilterRequest, FilterResponse};
use puffer_msgs::std_msgs::msg::Header;
use puffer_msgs::std_srvs::srv::{Trigger, TriggerResponse};
use puffer_ros::conversions::cloud_message;
use puffer_ros::large_data::{Delivery, LargeDataPublisher, LargeDataSubscription, Retention};
use puffer_ros::{Node, RosArgs, Shared, Stop};
use scan_store::ScanStore;
use std::sync::Arc;
use std::time::Duration;

/// How long a request waits for the scans and poses that it names.
const INPUT_DEADLINE: Duration = Duration::from_secs(30);

puffer_core::param_groups! {
    /// All parameters of the filter.
    pub struct Params {
        /// How scans are combined.
        filter: FilterParams,
    }
}

/// Runs the filter until `stop`.
///
/// # Errors
/// Parameters that do not fit, or no network.
pub async fn run(args: RosArgs, stop: Stop) -> Result<()> {
    let node: Node<Params> = Node::start("cloud_filter", args, stop.clone()).await?;
    let scans: LargeDataSubscription<RegisteredScan> =
        node.large_data_subscribe("registered_scan", Delivery::Every)?;
    let poses: LargeDataSubscription<RegisteredPoses> =
        node.large_data_subscribe("registered_poses", Delivery::Newest)?;
    let store = Shared::new(ScanStore::default());
    serve_filter(&node, &store)?;
    serve_reset(&node, &store)?;
    tracing::info!("ready");
    loop {
        let next = async {
            tokio::select! {
                scan = scans.next() => match scan {
                    Ok(scan) => {
                        let mut store = store.lock().await;
                        tokio::task::block_in_place(|| store.add(&scan))
                    }
                    Err(error) => Err(error.to_string()),
                },
                poses = poses.next() => match poses {
                    Ok(poses) => store.lock().await.set_corrected_poses(&poses),
                    Err(error) => Err(error.to_string()),
                },
            }
        };
        match stop.or(next).await {
            None => return Ok(()),
            Some(Ok(())) => node.diagnostics().set("scans", store.lock().await.len()),
            Some(Err(reason)) => tracing::warn!("a message is left out: {reason}"),
        }
    }
}

fn serve_filter(node: &Node<Params>, store: &Shared<ScanStore>) -> Result<()> {
    let clouds = Arc::new(node.large_data_publisher_for_any_reader::<PointCloud2>(
        "filtered_cloud",
        Retention::Latched,
    )?);
    let (shared, store) = (node.clone(), store.clone());
    node.serve::<Filter, _, _>("~/filter", move |request: FilterRequest| {
        let (node, store, clouds) = (shared.clone(), store.clone(), Arc::clone(&clouds));
        async move {
            if let Err(message) = wait_for_input(&store, &request).await {
                return failed(FilterResponse::SCANS_MISSING, message);
            }
            match combine(&node, &store, &clouds).await {
                Ok(response) => response,
                Err(error) => failed(FilterResponse::FAILED, format!("{error:#}")),
            }
        }
    })
}

/// Waits until the scans and poses that the request names have come.
async fn wait_for_input(
    store: &Shared<ScanStore>,
    request: &FilterRequest,
) -> std::result::Result<(), String> {
    let waited = store.wait_until(INPUT_DEADLINE, |store| {
        let (scans, revision, complete) = (store.len(), store.revision, store.is_complete());
        if scans >= request.scans as usize && revision >= request.revision && complete {
            return Ok(());
        }
        Err(format!(
            "{scans} of {} scans and revision {revision} of {} of the poses came within {} s{}",
            request.scans,
            request.revision,
            INPUT_DEADLINE.as_secs(),
            if complete { "" } else { ", but not the points that go with these poses" }
        ))
    });
    waited.await
}

/// Filters the accepted scans and publishes the cloud.
async fn combine(
    node: &Node<Params>,
    store: &Shared<ScanStore>,
    clouds: &LargeDataPublisher,
) -> Result<FilterResponse> {
    let params = node.params().filter;
    let (filtered, frame_id) = {
        let store = store.lock().await;
        (tokio::task::block_in_place(|| store.filter(&params))?, store.frame.clone())
    };
    let header = Header { stamp: node.now().into(), frame_id };
    clouds.publish_message(&cloud_message(&filtered.cloud, header)).await?;
    tracing::info!("{} points of {} measurements", filtered.cloud.len(), filtered.measurements);
    Ok(FilterResponse {
        success: true,
        points: filtered.cloud.len() as u32,
        measurements: filtered.measurements as u64,
        noise_radius: filtered.noise_radius as f32,
        reduction_radius: filtered.reduction_radius as f32,
        cloud_hash: cloud_hash(&filtered.cloud),
        ..FilterResponse::default()
    })
}

fn failed(error_code: u16, message: String) -> FilterResponse {
    tracing::error!("not filtered: {message}");
    FilterResponse { success: false, error_code, message, ..FilterResponse::default() }
}

fn serve_reset(node: &Node<Params>, store: &Shared<ScanStore>) -> Result<()> {
    let store = store.clone();
    node.serve::<Trigger, _, _>("~/reset", move |_| {
        let store = store.clone();
        async move {
            let mut store = store.lock().await;
            let message = format!("{} scans forgotten", store.len());
            *store = ScanStore::default();
            TriggerResponse { success: true, message }
        }
    })
}
