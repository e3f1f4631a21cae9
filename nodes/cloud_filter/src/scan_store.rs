//! The scans that the filter combines.

use puffer_core::filter::{FilterParams, Filtered, filter};
use puffer_core::geometry::Pose;
use puffer_core::register::Status;
use puffer_core::scan::PreparedScan;
use puffer_core::{Error, Progress};
use puffer_msgs::msg::{RegisteredPoses, RegisteredScan};
use puffer_ros::conversions::{pose_from_message, scan_from_message, status_from_message};
use std::collections::BTreeMap;

/// Scans by their numbers.
#[derive(Default)]
pub(crate) struct ScanStore {
    scans: BTreeMap<u32, StoredScan>,
    /// Revision of the newest corrected poses, 0 before the first.
    pub revision: u32,
    /// Distance between overlapping scans that came with the corrected poses, metres.
    residual: Option<f64>,
    /// The newest corrected poses.
    poses: Option<RegisteredPoses>,
    /// The frame that the scans are registered in.
    pub frame: String,
}

/// The newest version of a scan.
struct StoredScan {
    /// None if the scan shows nothing that could be combined.
    scan: Option<PreparedScan>,
    pose: Pose,
    status: Status,
    version: u32,
}

impl ScanStore {
    /// Number of scans that came.
    pub(crate) fn len(&self) -> usize {
        self.scans.len()
    }

    /// Adds a scan, or a newer version of one; an older one that comes late is passed over.
    ///
    /// # Errors
    /// What of the message does not fit, in words.
    pub(crate) fn add(&mut self, message: &RegisteredScan) -> Result<(), String> {
        if self.scans.get(&message.id).is_some_and(|stored| stored.version > message.version) {
            return Ok(());
        }
        let scan = scan_from_message(&message.cloud)?;
        let stored = StoredScan {
            // One without enough points was refused already.
            scan: PreparedScan::new(&scan).ok(),
            pose: pose_from_message(&message.object_from_sensor.pose)?,
            status: status_from_message(message.status)?,
            version: message.version,
        };
        self.scans.insert(message.id, stored);
        self.frame.clone_from(&message.header.frame_id);
        Ok(())
    }

    /// Sets the corrected poses of all usable scans.
    ///
    /// # Errors
    /// Lists that do not fit each other, in words.
    pub(crate) fn set_corrected_poses(&mut self, message: &RegisteredPoses) -> Result<(), String> {
        let count = message.ids.len();
        if message.status.len() != count || message.object_from_sensor.len() != count {
            return Err(format!(
                "{count} ids with {} verdicts and {} poses",
                message.status.len(),
                message.object_from_sensor.len()
            ));
        }
        for i in 0..count {
            pose_from_message(&message.object_from_sensor[i].pose)?;
            status_from_message(message.status[i])?;
        }
        (self.revision, self.residual) = (message.revision, Some(message.residual));
        self.poses = Some(message.clone());
        Ok(())
    }

    /// Whether the scans that the corrected poses go with have come.
    pub(crate) fn is_complete(&self) -> bool {
        let Some(poses) = &self.poses else { return true };
        poses.ids.iter().zip(&poses.versions).all(|(id, version)| {
            self.scans.get(id).is_some_and(|stored| stored.version >= *version)
        })
    }

    /// The corrected pose and status of scan `id`, if there are any.
    fn correction(&self, id: u32) -> Option<(Pose, Status)> {
        let poses = self.poses.as_ref()?;
        let i = poses.ids.iter().position(|other| *other == id)?;
        let pose = pose_from_message(&poses.object_from_sensor[i].pose).ok()?;
        Some((pose, status_from_message(poses.status[i]).ok()?))
    }

    /// The accepted scans with their newest poses, by id; a corrected pose and status replace those
    /// that came with the scan.
    fn accepted(&self) -> Vec<(&PreparedScan, Pose)> {
        let mut accepted = Vec::new();
        for (&id, stored) in &self.scans {
            let (pose, status) = self.correction(id).unwrap_or((stored.pose, stored.status));
            if let (Some(scan), true) = (&stored.scan, status.is_accepted()) {
                accepted.push((scan, pose));
            }
        }
        accepted
    }

    /// Combines the accepted scans.
    ///
    /// # Errors
    /// As [`filter`].
    pub(crate) fn filter(&self, params: &FilterParams) -> puffer_core::Result<Filtered> {
        let accepted = self.accepted();
        if accepted.is_empty() {
            return Err(Error::input(format!(
                "none of {} scans was accepted: there is nothing to combine",
                self.scans.len()
            )));
        }
        filter(&accepted, self.residual, params, &Progress::silent())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_core::geometry::Scan;
    use puffer_msgs::geometry_msgs::msg::PoseWithCovariance;
    use puffer_msgs::std_msgs::msg::Header;
    use puffer_ros::conversions::scan_message;

    fn scan(id: u32, version: u32, status: u8) -> RegisteredScan {
        let cloud = scan_message(&Scan::default(), Header::default());
        let header = Header { frame_id: "workpiece".to_owned(), ..Header::default() };
        let mut message =
            RegisteredScan { header, id, version, status, cloud, ..RegisteredScan::default() };
        message.object_from_sensor.pose.orientation.w = 1.0;
        message
    }

    fn poses(id: u32, version: u32, status: u8) -> RegisteredPoses {
        let mut pose = PoseWithCovariance::default();
        pose.pose.orientation.w = 1.0;
        RegisteredPoses {
            revision: 7,
            ids: vec![id],
            versions: vec![version],
            status: vec![status],
            object_from_sensor: vec![pose],
            residual: 1e-4,
            ..RegisteredPoses::default()
        }
    }

    #[test]
    fn an_older_version_of_a_scan_that_comes_late_is_passed_over() {
        let mut store = ScanStore::default();
        store.add(&scan(0, 2, RegisteredScan::ACCEPTED)).unwrap();
        store.add(&scan(0, 1, RegisteredScan::DEFERRED)).unwrap();
        assert_eq!(store.frame, "workpiece");
        assert_eq!((store.scans[&0].version, store.scans[&0].status), (2, Status::Accepted));
        store.add(&scan(0, 3, RegisteredScan::REFUSED)).unwrap();
        assert_eq!((store.len(), store.scans[&0].status), (1, Status::Refused));
    }

    #[test]
    fn corrected_poses_wait_for_the_points_that_go_with_them() {
        let mut store = ScanStore::default();
        assert!(store.is_complete());
        store.add(&scan(4, 1, RegisteredScan::ACCEPTED)).unwrap();
        store.set_corrected_poses(&poses(4, 2, RegisteredScan::REFUSED)).unwrap();
        assert!(!store.is_complete());
        store.add(&scan(4, 2, RegisteredScan::ACCEPTED)).unwrap();
        assert!(store.is_complete());
        assert_eq!(store.revision, 7);
        assert_eq!(store.correction(4).unwrap().1, Status::Refused);
        assert!(store.correction(5).is_none());
    }

    #[test]
    fn lists_of_different_lengths_are_refused_and_change_nothing() {
        let mut store = ScanStore::default();
        let mut message = poses(4, 2, RegisteredScan::ACCEPTED);
        message.ids.push(5);
        let error = store.set_corrected_poses(&message).unwrap_err();
        assert!(error.contains("2 ids with 1 verdicts and 1 poses"), "{error}");
        assert_eq!(store.revision, 0);
    }

    #[test]
    fn nothing_accepted_is_an_error_with_the_number_of_scans() {
        let mut store = ScanStore::default();
        store.add(&scan(0, 1, RegisteredScan::REFUSED)).unwrap();
        let error = store.filter(&FilterParams::default()).unwrap_err().to_string();
        assert!(error.contains("none of 1 scans was accepted"), "{error}");
    }
}
