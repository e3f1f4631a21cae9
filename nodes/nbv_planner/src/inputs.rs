//! Messages as the planner's inputs.

use anyhow::{Error, Result};
use puffer_core::geometry::Aabb;
use puffer_core::planner::{JointPositions, PlanRequest, PoseUpdate, ScanUpdate, ScanVersion};
use puffer_msgs::msg::{RegisteredPoses, RegisteredScan};
use puffer_msgs::sensor_msgs::msg::JointState;
use puffer_msgs::srv::PlanViewRequest;
use puffer_ros::conversions::{
    pose_from_message, region_from_message, scan_from_message, status_from_message,
};

/// A registered scan.
///
/// # Errors
/// A cloud, pose or status that is none, in words.
pub(crate) fn scan_update(message: &RegisteredScan) -> Result<ScanUpdate> {
    Ok(ScanUpdate {
        version: ScanVersion { id: message.id, version: message.version },
        scan: scan_from_message(&message.cloud).map_err(Error::msg)?,
        beyond: scan_from_message(&message.beyond).map_err(Error::msg)?,
        prior: pose_from_message(&message.prior).map_err(Error::msg)?,
        pose: pose_from_message(&message.object_from_sensor.pose).map_err(Error::msg)?,
        status: status_from_message(message.status).map_err(Error::msg)?,
        frame: message.header.frame_id.clone(),
    })
}

/// Corrected poses.
///
/// # Errors
/// A pose or status that is none, in words.
pub(crate) fn pose_updates(message: &RegisteredPoses) -> Result<Vec<PoseUpdate>> {
    let versions = message.ids.iter().zip(&message.versions);
    let poses = message.object_from_sensor.iter().zip(&message.status);
    let mut updates = Vec::new();
    for ((id, version), (pose, status)) in versions.zip(poses) {
        updates.push(PoseUpdate {
            version: ScanVersion { id: *id, version: *version },
            pose: pose_from_message(&pose.pose).map_err(Error::msg)?,
            status: status_from_message(*status).map_err(Error::msg)?,
        });
    }
    Ok(updates)
}

/// A request for a plan. `configured` is the region of interest where the request names none.
///
/// # Errors
/// A region that is none, in words.
pub(crate) fn plan_request(message: &PlanViewRequest, configured: &Aabb) -> Result<PlanRequest> {
    let required = message.accepted.iter().zip(&message.accepted_versions);
    Ok(PlanRequest {
        scans: message.scans as usize,
        revision: message.revision,
        required: required
            .map(|(id, version)| ScanVersion { id: *id, version: *version })
            .collect(),
        members: message.scans_listed.then(|| message.accepted.clone()),
        region: region_from_message(&message.roi, configured).map_err(Error::msg)?,
        point_factor: message.point_factor as usize,
        start: named_joints(&message.start),
        sent_to: named_joints(&message.sent_to),
    })
}

/// The positions of a joint state.
pub(crate) fn joint_positions(message: &JointState) -> JointPositions {
    JointPositions { names: message.name.clone(), positions: message.position.clone() }
}

/// The positions of a joint state, `None` if it names no joint.
fn named_joints(message: &JointState) -> Option<JointPositions> {
    (!message.name.is_empty()).then(|| joint_positions(message))
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_core::geometry::{Mat6, Pose, Scan, Vec3};
    use puffer_core::register::Status;
    use puffer_msgs::geometry_msgs::msg::Vector3;
    use puffer_msgs::std_msgs::msg::Header;
    use puffer_ros::conversions::{
        pose_message, pose_with_covariance, scan_message, status_message,
    };

    fn configured() -> Aabb {
        Aabb { min: Vec3::new(-0.2, -0.2, -0.03), max: Vec3::new(0.2, 0.2, 0.3) }
    }

    fn scan_of_two_points() -> RegisteredScan {
        let header = Header { frame_id: "workpiece".to_owned(), ..Header::default() };
        let points = vec![[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]];
        let scan = Scan { points, ..Scan::default() };
        let pose = Pose::translation(1.0, 2.0, 3.0);
        RegisteredScan {
            header: header.clone(),
            id: 4,
            version: 2,
            cloud: scan_message(&scan, header.clone()),
            beyond: scan_message(&Scan::default(), header),
            object_from_sensor: pose_with_covariance(&pose, &Mat6::identity()),
            prior: pose_message(&Pose::identity()),
            status: status_message(Status::Deferred),
            ..RegisteredScan::default()
        }
    }

    #[test]
    fn a_registered_scan_keeps_its_points_poses_and_frame() {
        let update = scan_update(&scan_of_two_points()).unwrap();
        assert_eq!(update.version, ScanVersion { id: 4, version: 2 });
        assert_eq!(update.scan.points, [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]);
        assert!(update.beyond.points.is_empty());
        assert_eq!((update.pose.translation.z, update.prior), (3.0, Pose::identity()));
        assert_eq!((update.status, update.frame.as_str()), (Status::Deferred, "workpiece"));
        let broken = RegisteredScan { status: 77, ..scan_of_two_points() };
        assert!(scan_update(&broken).is_err());
    }

    #[test]
    fn corrected_poses_go_with_their_scans() {
        let scan = scan_of_two_points();
        let mut poses = RegisteredPoses {
            ids: vec![3, 8],
            versions: vec![5, 6],
            status: vec![RegisteredScan::REFUSED, status_message(Status::Accepted)],
            object_from_sensor: vec![scan.object_from_sensor; 2],
            ..RegisteredPoses::default()
        };
        poses.object_from_sensor[1].pose.position.z = 7.0;
        let updates = pose_updates(&poses).unwrap();
        assert_eq!(updates[0].version, ScanVersion { id: 3, version: 5 });
        assert_eq!((updates[0].pose.translation.z, updates[0].status), (3.0, Status::Refused));
        assert_eq!((updates[1].pose.translation.z, updates[1].status), (7.0, Status::Accepted));
        poses.object_from_sensor[0].pose.orientation.w = f64::NAN;
        assert!(pose_updates(&poses).is_err());
    }

    #[test]
    fn a_request_that_names_nothing_asks_for_what_is_configured() {
        let request = plan_request(&PlanViewRequest::default(), &configured()).unwrap();
        assert_eq!(request.region, configured());
        assert_eq!((request.members, request.start, request.sent_to), (None, None, None));
        assert!(request.required.is_empty());
    }

    #[test]
    fn a_request_names_region_scans_and_joints() {
        let sent_to =
            JointState { name: vec!["a".into()], position: vec![0.5], ..JointState::default() };
        let message = PlanViewRequest {
            roi: Vector3 { x: 0.1, y: 0.2, z: 0.15 },
            scans_listed: true,
            accepted: vec![0, 2],
            accepted_versions: vec![1, 3],
            sent_to,
            ..PlanViewRequest::default()
        };
        let request = plan_request(&message, &configured()).unwrap();
        assert_eq!(request.region.min, Vec3::new(-0.05, -0.1, -0.03));
        assert_eq!(request.region.max, Vec3::new(0.05, 0.1, 0.15));
        assert_eq!(request.members.unwrap(), [0, 2]);
        assert_eq!(request.required[1], ScanVersion { id: 2, version: 3 });
        assert_eq!(request.sent_to.unwrap().positions, [0.5]);
        let roi = Vector3 { x: -0.1, y: 0.2, z: 0.15 };
        let broken = PlanViewRequest { roi, ..PlanViewRequest::default() };
        let error = plan_request(&broken, &configured()).unwrap_err().to_string();
        assert!(error.contains("roi"), "{error}");
    }
}
