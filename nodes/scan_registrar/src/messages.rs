//! The messages that the registrar publishes.

use puffer_core::geometry::Mat6;
use puffer_core::intake::Intake;
use puffer_core::register::Registration;
use puffer_msgs::msg::{RegisteredPoses, RegisteredScan};
use puffer_msgs::std_msgs::msg::Header;
use puffer_ros::Stamp;
use puffer_ros::conversions::{pose_message, pose_with_covariance, scan_message, status_message};

fn header(stamp: Stamp, frame: &str) -> Header {
    Header { stamp: stamp.into(), frame_id: frame.to_owned() }
}

/// Scan `id` with its newest pose and verdict, in the frame `object`.
pub(crate) fn registered_scan_message(id: usize, intake: &Intake, object: &str) -> RegisteredScan {
    let scan = intake.state(id);
    let (accepted, accepted_versions) = intake.accepted();
    let stamp = Stamp::from_nanos(scan.label.nanoseconds);
    let verdict = scan.verdict;
    let covariance = verdict.map_or_else(Mat6::zeros, |v| v.covariance);
    let free = verdict.map_or(&[][..], |v| &v.free_directions);
    RegisteredScan {
        header: header(stamp, object),
        id: id as u32,
        version: scan.version,
        cloud: scan_message(scan.object, header(stamp, &scan.label.frame)),
        beyond: scan_message(scan.beyond, header(stamp, &scan.label.frame)),
        object_from_sensor: pose_with_covariance(&scan.pose, &covariance),
        prior: pose_message(&scan.prior),
        status: status_message(scan.status()),
        reason: scan.reason.to_owned(),
        fitness: verdict.map_or(0.0, |v| v.fitness),
        overlap: verdict.map_or(0.0, |v| v.overlap),
        rmse: verdict.map_or(f64::NAN, |v| v.rmse),
        correspondences: verdict.map_or(0, |v| v.correspondences as u32),
        free_directions: free.iter().flat_map(|twist| twist.iter().copied()).collect(),
        accepted,
        accepted_versions,
    }
}

/// The poses of all usable scans after a refinement, in the frame `object`.
pub(crate) fn registered_poses_message(
    intake: &Intake,
    registration: &Registration,
    revision: u32,
    stamp: Stamp,
    object: &str,
) -> RegisteredPoses {
    let verdicts = &registration.verdicts;
    RegisteredPoses {
        header: header(stamp, object),
        revision,
        ids: intake.usable_ids().iter().map(|&id| id as u32).collect(),
        versions: intake.usable_ids().iter().map(|&id| intake.state(id).version).collect(),
        status: verdicts.iter().map(|v| status_message(v.status)).collect(),
        object_from_sensor: registration
            .poses
            .iter()
            .zip(verdicts)
            .map(|(pose, verdict)| pose_with_covariance(pose, &verdict.covariance))
            .collect(),
        residual: registration.residual.unwrap_or(f64::NAN),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_core::intake::ScanLabel;
    use puffer_ros::scans::RegistrarParams;

    #[test]
    fn a_scan_bears_the_frame_of_the_driver_and_the_object_s_as_it_is_configured() {
        let mut intake = Intake::new(RegistrarParams::default().intake());
        let label = ScanLabel { nanoseconds: 7_000_000_008, frame: "zivid_optical".to_owned() };
        let id = intake.add_unusable(label, "no transform".to_owned());
        let message = registered_scan_message(id, &intake, "workpiece");
        assert_eq!(message.header.frame_id, "workpiece");
        assert_eq!(message.cloud.header.frame_id, "zivid_optical");
        assert_eq!(message.beyond.header.frame_id, "zivid_optical");
    }
}
