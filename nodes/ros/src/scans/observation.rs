//! From a cloud message and the transforms at its stamp to an observation.

use super::ScanParams;
use crate::conversions::scan_from_message;
use crate::{Stamp, TfBuffer};
use puffer_core::Error;
use puffer_core::geometry::Pose;
use puffer_core::intake::{Observation, ScanLabel, posed_bodies};
use puffer_core::robot::RobotModel;
use puffer_msgs::sensor_msgs::msg::PointCloud2;

/// The time and the sensor frame of a cloud.
pub fn scan_label(cloud: &PointCloud2) -> ScanLabel {
    let stamp = &cloud.header.stamp;
    let nanoseconds = Stamp::new(stamp.sec, stamp.nanosec).nanos();
    ScanLabel { nanoseconds, frame: cloud.header.frame_id.clone() }
}

/// Puts a cloud and the transforms at its stamp together. `robot` describes the bodies to cut;
/// without it none is cut.
///
/// # Errors
/// What of the cloud does not fit, or which transform is missing, in words.
pub fn observe(
    cloud: &PointCloud2,
    tf: &TfBuffer,
    robot: Option<&RobotModel>,
    params: &ScanParams,
) -> Result<Observation, String> {
    let label = scan_label(cloud);
    let stamp = Stamp::from_nanos(label.nanoseconds);
    let prior = object_from(&label.frame, tf, stamp, params).map_err(|e| e.to_string())?;
    let bodies = match robot {
        Some(robot) => {
            posed_bodies(robot, &label.frame, |link| object_from(link, tf, stamp, params))
                .map_err(|e| e.to_string())?
        }
        None => Vec::new(),
    };
    let scan = scan_from_message(cloud)?;
    Ok(Observation::new(label, &scan, prior, bodies, &params.region()))
}

/// The pose of a frame in the object frame at `stamp`.
fn object_from(
    frame: &str,
    tf: &TfBuffer,
    stamp: Stamp,
    params: &ScanParams,
) -> puffer_core::Result<Pose> {
    tf.lookup(&params.object_frame, frame, stamp).map_err(|error| Error::input(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conversions::scan_message;
    use crate::tf::Transform;
    use puffer_core::geometry::Scan;
    use puffer_core::intake::Intake;
    use puffer_msgs::builtin_interfaces::msg::Time;
    use puffer_msgs::std_msgs::msg::Header;

    fn cloud(frame: &str) -> PointCloud2 {
        let stamp = Time { sec: 7, nanosec: 8 };
        let scan = Scan { points: vec![[0.0, 0.0, 0.1], [0.0, 0.0, 0.9]], ..Scan::default() };
        scan_message(&scan, Header { stamp, frame_id: frame.to_owned() })
    }

    fn tf() -> TfBuffer {
        let buffer = TfBuffer::default();
        let stamp = Stamp::new(0, 0);
        let pose = Pose::translation(0.0, 0.0, 0.05);
        let (parent, child) = ("object".into(), "camera".into());
        buffer.insert(Transform { parent, child, stamp, pose }, true);
        buffer
    }

    #[test]
    fn a_cloud_is_observed_at_its_stamp_in_its_frame_from_the_pose_of_tf() {
        let params = crate::scans::RegistrarParams::default();
        let observation = observe(&cloud("camera"), &tf(), None, &params.scan).unwrap();
        let expected = ScanLabel { nanoseconds: 7_000_000_008, frame: "camera".to_owned() };
        assert_eq!(observation.label, expected);
        assert_eq!(observation.prior, Pose::translation(0.0, 0.0, 0.05));
        let mut intake = Intake::new(params.intake());
        let id = intake.add(observation)[0];
        // 0.1 + 0.05 m lie within the height of the region, 0.9 + 0.05 m beyond.
        assert_eq!(intake.state(id).object.points, [[0.0, 0.0, 0.1]]);
        assert_eq!(intake.state(id).beyond.points, [[0.0, 0.0, 0.9]]);
    }

    #[test]
    fn a_missing_transform_is_told_by_its_frames() {
        let params = ScanParams::default();
        let error = observe(&cloud("zivid"), &tf(), None, &params).err().unwrap();
        assert!(error.contains("zivid"), "{error}");
    }
}
