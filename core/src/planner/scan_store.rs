//! The scans that have arrived.

use super::request::{PlanRequest, PoseUpdate, ScanUpdate, ScanVersion};
use crate::geometry::{Pose, Scan};
use crate::register::Status;
use std::collections::BTreeMap;

/// The newest version of a scan.
pub(super) struct StoredScan {
    pub(super) version: u32,
    pub(super) scan: Scan,
    pub(super) beyond: Scan,
    /// The pose that the robot reported.
    prior: Pose,
    pub(super) pose: Pose,
    pub(super) status: Status,
}

/// The newest version of each scan, and the revision of the newest corrected poses.
#[derive(Default)]
pub(super) struct ScanStore {
    scans: BTreeMap<u32, StoredScan>,
    /// Revision of the newest corrected poses; 0 if there were none.
    revision: u32,
}

impl ScanStore {
    /// Number of scans.
    pub(super) fn len(&self) -> usize {
        self.scans.len()
    }

    /// Forgets all scans and the revision.
    pub(super) fn clear(&mut self) {
        self.scans.clear();
        self.revision = 0;
    }

    /// The newest version of scan `id`.
    pub(super) fn get(&self, id: u32) -> Option<&StoredScan> {
        self.scans.get(&id)
    }

    /// Whether a newer version of the same scan is stored.
    pub(super) fn is_superseded(&self, update: ScanVersion) -> bool {
        self.get(update.id).is_some_and(|stored| stored.version > update.version)
    }

    /// Stores a scan in place of its older version.
    pub(super) fn insert(&mut self, update: ScanUpdate) {
        let ScanUpdate { version, scan, beyond, prior, pose, status, frame: _ } = update;
        let stored = StoredScan { version: version.version, scan, beyond, prior, pose, status };
        self.scans.insert(version.id, stored);
    }

    /// Corrects poses. A scan that is stored in a newer version than its corrected pose keeps its
    /// own pose.
    pub(super) fn correct_poses(&mut self, revision: u32, updates: &[PoseUpdate]) {
        for update in updates {
            let stored = self.scans.get_mut(&update.version.id);
            if let Some(stored) = stored.filter(|s| s.version <= update.version.version) {
                (stored.pose, stored.status) = (update.pose, update.status);
            }
        }
        self.revision = revision;
    }

    /// Numbers of the accepted scans, ascending.
    pub(super) fn accepted(&self) -> Vec<u32> {
        let accepted = self.scans.iter().filter(|(_, stored)| stored.status.is_accepted());
        accepted.map(|(id, _)| *id).collect()
    }

    /// The poses that the robot reported of the scans that were not accepted, by ascending number.
    pub(super) fn unaccepted_priors(&self) -> impl Iterator<Item = &Pose> {
        let others = self.scans.values().filter(|stored| !stored.status.is_accepted());
        others.map(|stored| &stored.prior)
    }

    /// The stored versions of the scans `ids`; unknown ones are left out.
    pub(super) fn versions(&self, ids: &[u32]) -> Vec<ScanVersion> {
        let versions =
            ids.iter().map(|id| Some(ScanVersion { id: *id, version: self.get(*id)?.version }));
        versions.flatten().collect()
    }

    /// What is missing of the scans and poses that a request names, in words.
    pub(super) fn missing(&self, request: &PlanRequest) -> Option<String> {
        if self.len() < request.scans {
            return Some(format!("{} of {} scans came", self.len(), request.scans));
        }
        if self.revision < request.revision {
            return Some(format!(
                "corrected poses of revision {} of {} came",
                self.revision, request.revision
            ));
        }
        let mut late = request.required.iter().filter(|required| {
            self.get(required.id).is_none_or(|stored| stored.version < required.version)
        });
        late.next().map(|ScanVersion { id, version }| {
            format!("scan {id} did not come in its version {version}")
        })
    }
}
