//! The scans that the filter combines.

use puffer_core::filter::{FilterParams, Filtered, filter};
use puffer_core::geometry::Pose;
use puffer_core::register::{PreparedScan, Status};
use puffer_core::{Error, Progress};
use puffer_msgs::msg::{RegisteredPoses, RegisteredScan};
use puffer_shell::convert::{pose_from_message, scan_from_message, status_from_message};
use std::collections::BTreeMap;

/// Scans by their numbers.
#[derive(Default)]
pub(crate) struct Store {
    scans: BTreeMap<u32, Held>,
    /// That of the newest corrected poses, 0 before the first.
    pub revision: u32,
    residual: Option<f64>,
    /// The newest corrected poses.
    poses: Option<RegisteredPoses>,
    /// The frame that the scans are registered in.
    pub frame: String,
}

struct Held {
    /// None if the scan shows nothing that could be combined.
    scan: Option<PreparedScan>,
    pose: Pose,
    status: Status,
    version: u32,
}

impl Store {
    /// Number of scans that came.
    pub(crate) fn len(&self) -> usize {
        self.scans.len()
    }

    /// Takes a scan, or a newer version of one; an older one that comes late is passed over.
    ///
    /// # Errors
    /// What of the message does not fit, in words.
    pub(crate) fn take(&mut self, message: &RegisteredScan) -> Result<(), String> {
        if self.scans.get(&message.id).is_some_and(|held| held.version > message.version) {
            return Ok(());
        }
        let scan = scan_from_message(&message.cloud)?;
        let held = Held {
            // One without enough points was refused already.
            scan: PreparedScan::new(&scan).ok(),
            pose: pose_from_message(&message.object_from_sensor.pose)?,
            status: status_from_message(message.status)?,
            version: message.version,
        };
        self.scans.insert(message.id, held);
        self.frame.clone_from(&message.header.frame_id);
        Ok(())
    }

    /// Takes corrected poses.
    ///
    /// # Errors
    /// Lists that do not fit each other, in words.
    pub(crate) fn correct(&mut self, message: &RegisteredPoses) -> Result<(), String> {
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
        poses
            .ids
            .iter()
            .zip(&poses.versions)
            .all(|(id, version)| self.scans.get(id).is_some_and(|held| held.version >= *version))
    }

    /// Puts the corrected poses in place of the scans' own.
    fn corrected(&self) -> Vec<(Pose, Status, Option<&PreparedScan>)> {
        let correction = |id: &u32| {
            let poses = self.poses.as_ref()?;
            let i = poses.ids.iter().position(|other| other == id)?;
            let pose = pose_from_message(&poses.object_from_sensor[i].pose).ok()?;
            Some((pose, status_from_message(poses.status[i]).ok()?))
        };
        self.scans
            .iter()
            .map(|(id, held)| {
                let (pose, status) = correction(id).unwrap_or((held.pose, held.status));
                (pose, status, held.scan.as_ref())
            })
            .collect()
    }

    /// Combines the accepted scans.
    ///
    /// # Errors
    /// As [`filter`].
    pub(crate) fn filter(&self, params: &FilterParams) -> puffer_core::Result<Filtered> {
        let accepted: Vec<(&PreparedScan, Pose)> = self
            .corrected()
            .into_iter()
            .filter(|(_, status, _)| *status == Status::Accepted)
            .filter_map(|(pose, _, scan)| Some((scan?, pose)))
            .collect();
        if accepted.is_empty() {
            return Err(Error::input(format!(
                "none of {} scans was accepted: there is nothing to combine",
                self.scans.len()
            )));
        }
        filter(&accepted, self.residual.unwrap_or(f64::NAN), params, &Progress::silent())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_core::geometry::Scan;
    use puffer_msgs::std_msgs::msg::Header;
    use puffer_shell::convert::scan_message;

    #[test]
    fn an_older_version_of_a_scan_that_comes_late_is_passed_over() {
        let mut store = Store::default();
        let scan = |version: u32, status: u8| {
            let cloud = scan_message(&Scan::default(), Header::default());
            let header = Header { frame_id: "workpiece".to_owned(), ..Header::default() };
            RegisteredScan { header, version, status, cloud, ..RegisteredScan::default() }
        };
        store.take(&scan(2, RegisteredScan::ACCEPTED)).unwrap();
        store.take(&scan(1, RegisteredScan::DEFERRED)).unwrap();
        assert_eq!(store.frame, "workpiece");
        assert_eq!((store.scans[&0].version, store.scans[&0].status), (2, Status::Accepted));
        store.take(&scan(3, RegisteredScan::REFUSED)).unwrap();
        assert_eq!((store.len(), store.scans[&0].status), (1, Status::Refused));
    }
}
