//! Raw scans and transforms to registered scans.
//!
//! Takes `points` and the transforms, cuts what is robot, gripper or table, and aligns the rest to the scans before
//! it, with the robot's pose as prior. Publishes `registered_scan` with a verdict, and after `~/refine` the
//! `registered_poses` of all scans.

mod messages;
mod refine;

pub use puffer_shell::scans::RegistrarParams as Params;

use anyhow::{Context, Result, anyhow};
use puffer_core::register::Status;
use puffer_core::robot::RobotModel;
use puffer_msgs::msg::RegisteredScan;
use puffer_msgs::sensor_msgs::msg::PointCloud2;
use puffer_msgs::std_msgs::msg::String as Text;
use puffer_msgs::std_srvs::srv::{Trigger, TriggerResponse};
use puffer_shell::bulk::{BulkPublisher, BulkSubscription, Delivery, Mode};
use puffer_shell::convert::status_from_message;
use puffer_shell::scans::{Intake, Observation};
use puffer_shell::{Node, Profile, RosArgs, Stamp, Stop, Subscription, TfBuffer};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Mutex;

/// Scans that wait for readers at most.
const SCANS_HELD: usize = 4;

/// Runs the registrar until `stop`.
///
/// # Errors
/// Parameters that do not fit, or no network.
pub async fn run(args: RosArgs, stop: Stop) -> Result<()> {
    let node: Node<Params> = Node::start("scan_registrar", args, stop.clone()).await?;
    let points: BulkSubscription<PointCloud2> =
        node.bulk_subscribe_from_all("points", Delivery::Every)?;
    let scans =
        Arc::new(node.bulk_publisher("registered_scan", Mode::Queue { depth: SCANS_HELD })?);
    let descriptions = node.subscribe("robot_description", Profile::LatchedSub)?;
    let tf = node.tf()?;
    let intake = Arc::new(Mutex::new(Intake::new(node.params())));
    refine::serve(&node, &intake, &scans)?;
    serve_reset(&node, &intake)?;
    let mut desk = Desk { node: node.clone(), intake, scans, robot: None, descriptions, tf };
    tracing::info!("ready");
    loop {
        match stop.or(points.next()).await {
            None => return Ok(()),
            Some(Ok(cloud)) => desk.take(&cloud).await?,
            Some(Err(error)) => tracing::warn!("{error}"),
        }
    }
}

/// Where scans arrive.
struct Desk {
    node: Node<Params>,
    intake: Arc<Mutex<Intake>>,
    scans: Arc<BulkPublisher>,
    /// The robot, or what is wrong with its newest description.
    robot: Option<Result<RobotModel, String>>,
    descriptions: Subscription<Text>,
    tf: TfBuffer,
}

impl Desk {
    /// Registers a scan and publishes what is new. One that cannot be used is refused with the reason.
    async fn take(&mut self, cloud: &PointCloud2) -> Result<()> {
        let observed = self.observe(cloud).await;
        let mut intake = self.intake.lock().await;
        let changed = match observed {
            Ok(observation) => tokio::task::block_in_place(|| intake.add(observation)),
            Err(error) => {
                let stamp = Stamp::new(cloud.header.stamp.sec, cloud.header.stamp.nanosec);
                vec![intake.add_unusable(stamp, &cloud.header.frame_id, format!("{error:#}"))]
            }
        };
        let object = self.node.params().scan.object_frame;
        let messages: Vec<RegisteredScan> =
            changed.into_iter().map(|id| messages::scan(id, &intake, &object)).collect();
        drop(intake);
        for message in messages {
            self.publish(&message).await?;
        }
        Ok(())
    }

    async fn observe(&mut self, cloud: &PointCloud2) -> Result<Observation> {
        let params = self.node.params().scan;
        let deadline = Duration::from_secs_f64(params.tf_deadline);
        let stamp = Stamp::new(cloud.header.stamp.sec, cloud.header.stamp.nanosec);
        self.tf.wait(&params.object_frame, &cloud.header.frame_id, stamp, deadline).await?;
        if params.cut_bodies {
            self.describe(deadline).await?;
        }
        let robot = self.robot.as_ref().filter(|_| params.cut_bodies);
        let robot = robot.map(|robot| robot.as_ref().map_err(|fault| anyhow!("{fault}")));
        let robot = robot.transpose()?;
        Observation::new(cloud, &self.tf, robot, &params).map_err(anyhow::Error::msg)
    }

    /// Takes the newest description; waits for the first one.
    async fn describe(&mut self, deadline: Duration) -> Result<()> {
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

fn serve_reset(node: &Node<Params>, intake: &Arc<Mutex<Intake>>) -> Result<()> {
    let (shared, intake) = (node.clone(), Arc::clone(intake));
    node.serve::<Trigger, _, _>("~/reset", move |_| {
        let (node, intake) = (shared.clone(), Arc::clone(&intake));
        async move {
            let mut intake = intake.lock().await;
            let message = format!("{} scans forgotten", intake.len());
            intake.restart(node.params());
            TriggerResponse { success: true, message }
        }
    })
}
