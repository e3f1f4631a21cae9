//! Raw scans and transforms to registered scans.
//!
//! Takes `points` and the transforms, cuts what is robot, gripper or table, and aligns the rest to
//! the scans before it, with the robot's pose as prior. Publishes `registered_scan` with a verdict,
//! and after `~/refine` the `registered_poses` of all scans.

mod messages;
mod refinement;

pub use puffer_ros::scans::RegistrarParams as Params;

use anyhow::{Context, Result, anyhow};
use messages::registered_scan_message;
use puffer_core::intake::{Intake, Observation};
use puffer_core::register::Status;
use puffer_core::robot::RobotModel;
use puffer_msgs::msg::RegisteredScan;
use puffer_msgs::sensor_msgs::msg::PointCloud2;
use puffer_msgs::std_msgs::msg::String as Text;
use puffer_msgs::std_srvs::srv::{Trigger, TriggerResponse};
use puffer_ros::conversions::status_from_message;
use puffer_ros::large_data::{Delivery, LargeDataPublisher, LargeDataSubscription, Retention};
use puffer_ros::scans::{observe, scan_label};
use puffer_ros::{Node, QosProfile, RosArgs, Shared, Stamp, Stop, Subscription, TfBuffer};
use std::sync::Arc;
use std::time::Duration;

/// Scans that are kept for slow readers at most.
const QUEUE_DEPTH: usize = 4;

/// Runs the registrar until `stop`.
///
/// # Errors
/// Parameters that do not fit, or no network.
pub async fn run(args: RosArgs, stop: Stop) -> Result<()> {
    let node: Node<Params> = Node::start("scan_registrar", args, stop.clone()).await?;
    let points: LargeDataSubscription<PointCloud2> =
        node.large_data_subscribe_from_any_writer("points", Delivery::Every)?;
    let scans = Arc::new(
        node.large_data_publisher("registered_scan", Retention::Queue { depth: QUEUE_DEPTH })?,
    );
    let descriptions = node.subscribe("robot_description", QosProfile::LatchedSub)?;
    let tf = node.tf()?;
    let intake = Shared::new(Intake::new(node.params().intake()));
    refinement::serve_refine(&node, &intake, &scans)?;
    serve_reset(&node, &intake)?;
    let mut receiver =
        ScanReceiver { node: node.clone(), intake, scans, robot: None, descriptions, tf };
    tracing::info!("ready");
    loop {
        match stop.or(points.next()).await {
            None => return Ok(()),
            Some(Ok(cloud)) => receiver.on_cloud(&cloud).await?,
            Some(Err(error)) => tracing::warn!("{error}"),
        }
    }
}

/// Registers the scans that arrive.
struct ScanReceiver {
    node: Node<Params>,
    intake: Shared<Intake>,
    scans: Arc<LargeDataPublisher>,
    /// The robot, or what is wrong with its newest description.
    robot: Option<Result<RobotModel, String>>,
    descriptions: Subscription<Text>,
    tf: TfBuffer,
}

impl ScanReceiver {
    /// Registers a scan and publishes all scans whose pose or verdict is new. A scan that cannot be
    /// used is refused with the reason.
    async fn on_cloud(&mut self, cloud: &PointCloud2) -> Result<()> {
        let observed = self.observe(cloud).await;
        let mut intake = self.intake.lock().await;
        let changed = match observed {
            Ok(observation) => tokio::task::block_in_place(|| intake.add(observation)),
            Err(error) => vec![intake.add_unusable(scan_label(cloud), format!("{error:#}"))],
        };
        let object = self.node.params().scan.object_frame;
        let messages: Vec<RegisteredScan> =
            changed.into_iter().map(|id| registered_scan_message(id, &intake, &object)).collect();
        drop(intake);
        for message in messages {
            self.publish(&message).await?;
        }
        Ok(())
    }

    /// Puts the cloud and the transforms at its stamp together, once they have arrived.
    async fn observe(&mut self, cloud: &PointCloud2) -> Result<Observation> {
        let params = self.node.params().scan;
        let deadline = Duration::from_secs_f64(params.tf_deadline);
        let stamp = Stamp::new(cloud.header.stamp.sec, cloud.header.stamp.nanosec);
        self.tf.wait(&params.object_frame, &cloud.header.frame_id, stamp, deadline).await?;
        if params.cut_bodies {
            self.update_robot(deadline).await?;
        }
        let robot = self.robot.as_ref().filter(|_| params.cut_bodies);
        let robot = robot.map(|robot| robot.as_ref().map_err(|fault| anyhow!("{fault}")));
        let robot = robot.transpose()?;
        observe(cloud, &self.tf, robot, &params).map_err(anyhow::Error::msg)
    }

    /// Takes over the newest robot description; waits for the first one.
    async fn update_robot(&mut self, deadline: Duration) -> Result<()> {
        let mut newest = None;
        while let Some(text) = self.descriptions.try_next() {
            newest = Some(text);
        }
        if newest.is_none() && self.robot.is_none() {
            newest = Some(self.descriptions.next_within(deadline).await.context(
                "the robot's bodies cannot be cut: publish robot_description, or set scan.cut_bodies to false",
            )?);
        }
        if let Some(text) = newest {
            let robot = RobotModel::from_urdf(&text.data);
            self.robot = Some(robot.map_err(|fault| format!("robot_description: {fault}")));
        }
        Ok(())
    }

    async fn publish(&self, message: &RegisteredScan) -> Result<()> {
        let status = status_from_message(message.status).map_or("unknown", Status::word);
        tracing::info!(
            "scan {} {status}: {}; {} points, overlap {:.0} %",
            message.id,
            message.reason,
            message.cloud.width,
            message.overlap * 100.0
        );
        self.node.diagnostics().count(&format!("scans {status}"));
        self.scans.publish_message(message).await?;
        Ok(())
    }
}

fn serve_reset(node: &Node<Params>, intake: &Shared<Intake>) -> Result<()> {
    let (shared, intake) = (node.clone(), intake.clone());
    node.serve::<Trigger, _, _>("~/reset", move |_| {
        let (node, intake) = (shared.clone(), intake.clone());
        async move {
            let mut intake = intake.lock().await;
            let message = format!("{} scans forgotten", intake.len());
            intake.restart(node.params().intake());
            TriggerResponse { success: true, message }
        }
    })
}
