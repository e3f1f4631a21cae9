//! Registration of scans as they come.

use super::align::{Map, Prior};
use super::judge::{Status, Verdict};
use super::params::RegisterParams;
use super::registration::Registration;
use super::registration_problem::RegistrationProblem;
use super::registration_scan::RegistrationScan;
use super::scan_registration::register_scan;
use super::strategy::Strategy;
use crate::geometry::Pose;
use crate::scan::{PoseSigma, PreparedScan};
use crate::{Progress, Result};

/// Deferred scans that a new one is paired with at most, the latest first: an earlier one rarely
/// shows the same side of the object.
const MAX_PAIRING_TRIALS: usize = 4;

/// Takes scans one by one: each is aligned to those accepted before it, and deferred ones are tried
/// again whenever the map has grown (Wiedemann 2014, §2.3.1).
pub struct Registrar {
    strategy: Strategy,
    pose_sigma: PoseSigma,
    entries: Vec<RegistrarEntry>,
    /// Of all accepted scans; none before the first.
    map: Option<Map>,
}

/// One scan that the registrar has taken.
struct RegistrarEntry {
    scan: RegistrationScan,
    /// The robot's `object_from_sensor`.
    robot: Pose,
    /// Estimated `object_from_sensor`.
    pose: Pose,
    verdict: Verdict,
    /// How often it was aligned to the map.
    trials: usize,
}

impl Registrar {
    /// A registrar without scans; `pose_sigma` is the robot's.
    pub fn new(pose_sigma: PoseSigma, params: RegisterParams) -> Registrar {
        let strategy = Strategy::new(&params);
        Registrar { strategy, pose_sigma, entries: Vec::new(), map: None }
    }

    /// Number of scans taken.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether no scan was taken yet.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Estimated pose `object_from_sensor` of scan `index`.
    pub fn pose(&self, index: usize) -> Pose {
        self.entries[index].pose
    }

    /// What became of scan `index`.
    pub fn verdict(&self, index: usize) -> &Verdict {
        &self.entries[index].verdict
    }

    /// Takes a scan with the robot's pose `object_from_sensor`. Returns the scans whose pose or
    /// verdict is new: this one first, then deferred ones that could be registered now.
    pub fn add(&mut self, scan: &PreparedScan, robot: &Pose) -> Vec<usize> {
        let scan = RegistrationScan::new(scan, self.pose_sigma, &self.strategy);
        let index = self.entries.len();
        let mut verdict = Verdict::deferred(&self.pose_sigma.information());
        let is_first = self.map.is_none();
        if is_first {
            verdict.status = Status::Accepted;
            self.map = Some(scan.own_map(robot, scan.map_spacing));
        }
        self.entries.push(RegistrarEntry { scan, robot: *robot, pose: *robot, verdict, trials: 0 });
        let mut changed = vec![index];
        if is_first {
            return changed;
        }
        if self.try_to_register(index) {
            changed.extend(self.retry_deferred());
        } else if let Some(partner) = self.pair_with_deferred(index) {
            changed.push(partner);
            changed.extend(self.retry_deferred());
        }
        changed
    }

    /// Looks for a deferred scan that scan `index` fits: the two join together, where the robot
    /// puts the one that came first. Otherwise nothing could be built on a first scan that no other
    /// overlaps with. By the thesis's method each waits for the first scan's map.
    fn pair_with_deferred(&mut self, index: usize) -> Option<usize> {
        if !self.strategy.may_start_elsewhere {
            return None;
        }
        let new = &self.entries[index];
        let voxel = self.entries[0].scan.map_spacing;
        let prior = Prior::relative_to_map(&new.robot, self.pose_sigma);
        let deferred =
            (0..index).rev().filter(|&i| self.entries[i].verdict.status == Status::Deferred);
        let (partner, pose, verdict) = deferred.take(MAX_PAIRING_TRIALS).find_map(|i| {
            let partner = &self.entries[i];
            let map = partner.scan.own_map(&partner.robot, voxel);
            let (pose, verdict) = register_scan(&new.scan, &map, &prior, &self.strategy);
            verdict.is_accepted().then_some((i, pose, verdict))
        })?;
        let verdict_of_partner = Verdict {
            reason: format!("stands where the robot put it; scan {index} is aligned to it"),
            ..Verdict::first(&self.pose_sigma.information())
        };
        self.accept(partner, self.entries[partner].robot, verdict_of_partner);
        self.accept(index, pose, verdict);
        Some(partner)
    }

    fn accept(&mut self, index: usize, pose: Pose, verdict: Verdict) {
        let entry = &mut self.entries[index];
        if let Some(map) = &mut self.map {
            entry.scan.add_to(map, &pose);
        }
        (entry.pose, entry.verdict) = (pose, verdict);
    }

    /// Tries all deferred scans until none can be registered; returns those that could.
    fn retry_deferred(&mut self) -> Vec<usize> {
        let mut registered = Vec::new();
        loop {
            let deferred: Vec<usize> = (0..self.entries.len())
                .filter(|&i| self.entries[i].verdict.status == Status::Deferred)
                .filter(|&i| self.entries[i].trials < self.strategy.params.max_rounds)
                .collect();
            let found: Vec<usize> =
                deferred.into_iter().filter(|&i| self.try_to_register(i)).collect();
            if found.is_empty() {
                return registered;
            }
            registered.extend(found);
        }
    }

    /// Aligns scan `index` to the map; returns whether it was accepted.
    fn try_to_register(&mut self, index: usize) -> bool {
        let Some(map) = &self.map else { return false };
        let entry = &mut self.entries[index];
        entry.trials += 1;
        let prior = Prior::relative_to_map(&entry.robot, self.pose_sigma);
        let (pose, verdict) = register_scan(&entry.scan, map, &prior, &self.strategy);
        let accepted = verdict.is_accepted();
        if accepted {
            self.accept(index, pose, verdict);
        } else {
            entry.verdict = verdict;
        }
        accepted
    }

    /// Registers all scans anew and together, as [`super::register`] does; the result replaces the
    /// poses and verdicts so far.
    ///
    /// # Errors
    /// As [`super::register`].
    pub fn refine(&mut self, progress: &Progress) -> Result<Registration> {
        let scans: Vec<&RegistrationScan> = self.entries.iter().map(|entry| &entry.scan).collect();
        let robot: Vec<Pose> = self.entries.iter().map(|entry| entry.robot).collect();
        let problem = RegistrationProblem {
            scans: &scans,
            robot: &robot,
            pose_sigma: self.pose_sigma,
            strategy: &self.strategy,
            progress,
        };
        let registration = problem.solve()?;
        self.adopt(&registration);
        Ok(registration)
    }

    /// Takes over the poses and verdicts of a registration of all scans taken; does nothing if that
    /// is one of another number of scans.
    pub fn adopt(&mut self, registration: &Registration) {
        if registration.poses.len() != self.entries.len() || self.entries.is_empty() {
            return;
        }
        let outcome = registration.poses.iter().zip(&registration.verdicts);
        for (entry, (pose, verdict)) in self.entries.iter_mut().zip(outcome) {
            (entry.pose, entry.verdict) = (*pose, verdict.clone());
        }
        let accepted = self.entries.iter().filter(|entry| entry.verdict.is_accepted());
        let placed = accepted.map(|entry| (&entry.scan, &entry.pose));
        self.map = Some(RegistrationScan::map_of(placed, self.entries[0].scan.map_spacing));
    }
}
