//! What the registrar says of its scans.

use puffer_core::geometry::Mat6;
use puffer_core::register::Registration;
use puffer_msgs::builtin_interfaces::msg::Time;
use puffer_msgs::msg::{RegisteredPoses, RegisteredScan};
use puffer_msgs::std_msgs::msg::Header;
use puffer_shell::Stamp;
use puffer_shell::convert::{pose_message, pose_with_covariance, scan_message, status_message};
use puffer_shell::scans::Intake;

fn header(stamp: Stamp, frame: &str) -> Header {
    let (sec, nanosec) = stamp.parts();
    Header { stamp: Time { sec, nanosec }, frame_id: frame.to_owned() }
}

/// Scan `id` as it stands, in the frame `object`.
pub(crate) fn scan(id: usize, intake: &Intake, object: &str) -> RegisteredScan {
    let scan = intake.scan(id);
    let (accepted, accepted_versions) = intake.accepted();
    let verdict = scan.verdict;
    let covariance = verdict.map_or_else(Mat6::zeros, |v| v.covariance);
    let free = verdict.map_or(&[][..], |v| &v.free_directions);
    RegisteredScan {
        header: header(scan.stamp, object),
        id: id as u32,
        version: scan.version,
        cloud: scan_message(scan.scan, header(scan.stamp, scan.frame)),
        beyond: scan_message(scan.beyond, header(scan.stamp, scan.frame)),
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

/// The poses of all usable scans after a refinement.
pub(crate) fn poses(
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
        ids: intake.usable().iter().map(|&id| id as u32).collect(),
        versions: intake.usable().iter().map(|&id| intake.scan(id).version).collect(),
        status: verdicts.iter().map(|v| status_message(v.status)).collect(),
        object_from_sensor: registration
            .poses
            .iter()
            .zip(verdicts)
            .map(|(pose, verdict)| pose_with_covariance(pose, &verdict.covariance))
            .collect(),
        residual: registration.residual,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_shell::scans::RegistrarParams;

    #[test]
    fn a_scan_bears_the_frame_of_the_driver_and_the_object_s_as_it_is_configured() {
        let mut intake = Intake::new(RegistrarParams::default());
        let id = intake.add_unusable(Stamp::new(7, 8), "zivid_optical", "no transform".to_owned());
        let message = scan(id, &intake, "workpiece");
        assert_eq!(message.header.frame_id, "workpiece");
        assert_eq!(message.cloud.header.frame_id, "zivid_optical");
        assert_eq!(message.beyond.header.frame_id, "zivid_optical");
    }
}
