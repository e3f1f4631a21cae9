//! Registered scans to one filtered cloud.
//!
//! Holds `registered_scan` and follows `registered_poses`; on `~/filter` combines all accepted scans to
//! `filtered_cloud` (latched): x y z, normal, sigma, support.

mod store;

use anyhow::Result;
use puffer_core::filter::FilterParams;
use puffer_core::pipeline::cloud_hash;
use puffer_msgs::builtin_interfaces::msg::Time;
use puffer_msgs::msg::{RegisteredPoses, RegisteredScan};
use puffer_msgs::sensor_msgs::msg::PointCloud2;
use puffer_msgs::srv::{Filter, FilterRequest, FilterResponse};
use puffer_msgs::std_msgs::msg::Header;
use puffer_msgs::std_srvs::srv::{Trigger, TriggerResponse};
use puffer_shell::bulk::{BulkPublisher, BulkSubscription, Delivery, Mode};
use puffer_shell::convert::cloud_message;
use puffer_shell::{Node, RosArgs, Stop};
use std::sync::Arc;
use std::time::{Duration, Instant};
use store::Store;
use tokio::sync::Mutex;

/// How long a request waits for what it says has been sent.
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
    let scans: BulkSubscription<RegisteredScan> =
        node.bulk_subscribe("registered_scan", Delivery::Every)?;
    let poses: BulkSubscription<RegisteredPoses> =
        node.bulk_subscribe("registered_poses", Delivery::Newest)?;
    let store = Arc::new(Mutex::new(Store::default()));
    serve_filter(&node, &store)?;
    serve_reset(&node, &store)?;
    tracing::info!("ready");
    loop {
        let next = async {
            tokio::select! {
                scan = scans.next() => match scan {
                    Ok(scan) => {
                        let mut store = store.lock().await;
                        tokio::task::block_in_place(|| store.take(&scan))
                    }
                    Err(error) => Err(error.to_string()),
                },
                poses = poses.next() => match poses {
                    Ok(poses) => store.lock().await.correct(&poses),
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

fn serve_filter(node: &Node<Params>, store: &Arc<Mutex<Store>>) -> Result<()> {
    let clouds =
        Arc::new(node.bulk_publisher_for_all::<PointCloud2>("filtered_cloud", Mode::Latched)?);
    let (shared, store) = (node.clone(), Arc::clone(store));
    node.serve::<Filter, _, _>("~/filter", move |request: FilterRequest| {
        let (node, store, clouds) = (shared.clone(), Arc::clone(&store), Arc::clone(&clouds));
        async move {
            if let Err(message) = wait_for(&store, &request).await {
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
async fn wait_for(
    store: &Mutex<Store>,
    request: &FilterRequest,
) -> std::result::Result<(), String> {
    let since = Instant::now();
    loop {
        let (scans, revision, complete) = {
            let store = store.lock().await;
            (store.len(), store.revision, store.is_complete())
        };
        if scans >= request.scans as usize && revision >= request.revision && complete {
            return Ok(());
        }
        if since.elapsed() > INPUT_DEADLINE {
            return Err(format!(
                "{scans} of {} scans and revision {revision} of {} of the poses came within {} s{}",
                request.scans,
                request.revision,
                INPUT_DEADLINE.as_secs(),
                if complete { "" } else { ", but not the points that go with these poses" }
            ));
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

async fn combine(
    node: &Node<Params>,
    store: &Mutex<Store>,
    clouds: &BulkPublisher,
) -> Result<FilterResponse> {
    let params = node.params().filter;
    let (filtered, frame_id) = {
        let store = store.lock().await;
        (tokio::task::block_in_place(|| store.filter(&params))?, store.frame.clone())
    };
    let (sec, nanosec) = node.now().parts();
    let header = Header { stamp: Time { sec, nanosec }, frame_id };
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

fn serve_reset(node: &Node<Params>, store: &Arc<Mutex<Store>>) -> Result<()> {
    let store = Arc::clone(store);
    node.serve::<Trigger, _, _>("~/reset", move |_| {
        let store = Arc::clone(&store);
        async move {
            let mut store = store.lock().await;
            let message = format!("{} scans forgotten", store.len());
            *store = Store::default();
            TriggerResponse { success: true, message }
        }
    })
}
