//! The scans of a bag.

use super::{RegistrarParams, observe};
use crate::TfBuffer;
use crate::bag::{BagReader, BagTopic};
use anyhow::{Context, Result, anyhow, bail};
use puffer_core::Progress;
use puffer_core::intake::Intake;
use puffer_core::robot::RobotModel;
use puffer_core::scan_files::ScanSet;
use puffer_msgs::Interface;
use puffer_msgs::sensor_msgs::msg::PointCloud2;
use puffer_msgs::std_msgs::msg::String as Text;
use puffer_msgs::tf2_msgs::msg::TFMessage;
use std::path::Path;
use std::time::Duration;

/// Last part of the name of the topic that raw scans are expected on.
const RAW_SCAN_TOPIC: &str = "points";
/// Name of the metadata record that a run leaves in its bag.
pub const RUN_METADATA_NAME: &str = "puffer";
/// Key of the entry of that record which holds the parameter file of all nodes.
pub const PARAMETERS_METADATA_KEY: &str = "params";

/// Whether `path` is a bag by its name: an `.mcap` file, or a folder with a rosbag2
/// `metadata.yaml`.
pub fn is_bag(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap"))
        || path.join("metadata.yaml").is_file()
}

/// Reads the clouds and transforms of a bag and puts them together as scan_registrar does in a run:
/// the usable scans with the robot's poses.
///
/// # Errors
/// No bag, no cloud, more than one topic that may hold the scans, or clouds without transforms.
pub fn scans_of_bag(path: &Path, params: &RegistrarParams, progress: &Progress) -> Result<ScanSet> {
    let name = path.display().to_string();
    let bag = BagReader::open(path)?;
    let info = bag.info();
    let points = points_topic(&info.topics).with_context(|| name.clone())?.to_owned();
    let clouds = info.topics.iter().find(|t| *t.name == *points).map_or(0, |t| t.count);
    // The transforms of the whole bag are kept.
    let tf = TfBuffer::new(Duration::MAX);
    let mut robot = None;
    for message in bag.messages(&["/tf", "/tf_static", "/robot_description"])? {
        let message = message?;
        if &*message.topic == "/robot_description" {
            let text: Text = message.decode()?;
            robot = Some(
                RobotModel::from_urdf(&text.data)
                    .context("robot_description")
                    .with_context(|| name.clone())?,
            );
        } else {
            let transforms: TFMessage = message.decode()?;
            tf.insert_message(&transforms, &*message.topic == "/tf_static")
                .map_err(|reason| anyhow!("{}: {}: {reason}", name, message.topic))?;
        }
    }
    if params.scan.cut_bodies && robot.is_none() {
        bail!(
            "{}: has no /robot_description, so robot, gripper and table cannot be cut: record it, or set \
             scan.cut_bodies to false",
            name
        );
    }
    let robot = robot.filter(|_| params.scan.cut_bodies);
    let mut intake = Intake::new(params.intake());
    for (index, message) in bag.messages(&[&points])?.enumerate() {
        progress.report("read", index as f64 / clouds.max(1) as f64)?;
        let cloud: PointCloud2 = message?.decode()?;
        let stamp = &cloud.header.stamp;
        let observation = observe(&cloud, &tf, robot.as_ref(), &params.scan).map_err(|reason| {
            anyhow!("{}: the cloud of {}.{:09} s: {reason}", name, stamp.sec, stamp.nanosec)
        })?;
        intake.add(observation);
    }
    progress.report("read", 1.0)?;
    if !intake.usable_ids().is_empty() {
        intake.settle(progress)?;
    }
    let views = intake.views();
    if views.is_empty() {
        bail!("{}: none of its {} scans shows anything of the object", name, intake.len());
    }
    Ok(ScanSet { views, pose_sigma: Some(params.scan.pose_sigma()), ..ScanSet::default() })
}

/// The topic that holds the raw scans.
fn points_topic(topics: &[BagTopic]) -> Result<&str> {
    let clouds: Vec<&str> = topics
        .iter()
        .filter(|topic| *topic.type_name == *PointCloud2::TYPE_NAME)
        .map(|topic| &*topic.name)
        .collect();
    let named = clouds.iter().find(|name| name.rsplit('/').next() == Some(RAW_SCAN_TOPIC));
    match (named, clouds.as_slice()) {
        (Some(name), _) => Ok(name),
        (None, [only]) => Ok(only),
        (None, []) => bail!("has no PointCloud2: record the sensor's `points`"),
        (None, several) => bail!(
            "has several topics of PointCloud2 and none is called {RAW_SCAN_TOPIC}: {}; remap the scans to {RAW_SCAN_TOPIC}",
            several.join(", ")
        ),
    }
}
