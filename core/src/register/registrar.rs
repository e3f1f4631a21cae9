//! Registration of scans as they come.

use super::align::{Map, Prior};
use super::place::place;
use super::sample::Sample;
use super::stages::waiting;
use super::verdict::{Status, Verdict};
use super::{Method, PoseSigma, PreparedScan, RegisterParams, Registration, register_samples};
use crate::geometry::Pose;
use crate::{Progress, Result};

/// Scans that wait which a new one is tried with, the latest first.
const PARTNERS: usize = 4;

/// Takes scans one by one: each is aligned to those accepted before it, and those put aside are tried again
/// whenever the map has grown (Wiedemann 2014, §2.3.1).
pub struct Registrar {
    params: RegisterParams,
    pose_sigma: PoseSigma,
    samples: Vec<Sample>,
    robot: Vec<Pose>,
    tries: Vec<usize>,
    poses: Vec<Pose>,
    verdicts: Vec<Verdict>,
    map: Option<Map>,
}

impl Registrar {
    /// A registrar without scans; `pose_sigma` is the robot's.
    pub fn new(pose_sigma: PoseSigma, params: RegisterParams) -> Registrar {
        Registrar {
            params,
            pose_sigma,
            samples: Vec::new(),
            robot: Vec::new(),
            tries: Vec::new(),
            poses: Vec::new(),
            verdicts: Vec::new(),
            map: None,
        }
    }

    /// Number of scans taken.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Whether no scan was taken yet.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Estimated pose `object_from_sensor` of scan `index`.
    pub fn pose(&self, index: usize) -> Pose {
        self.poses[index]
    }

    /// What became of scan `index`.
    pub fn verdict(&self, index: usize) -> &Verdict {
        &self.verdicts[index]
    }

    /// Takes a scan with the robot's pose `object_from_sensor`. Returns the scans whose pose or verdict is new, this
    /// one first; others had been put aside and were placed now.
    pub fn add(&mut self, scan: &PreparedScan, robot: &Pose) -> Vec<usize> {
        let sample = Sample::new(scan, self.pose_sigma, &self.params);
        let index = self.samples.len();
        self.robot.push(*robot);
        self.poses.push(*robot);
        self.tries.push(0);
        self.verdicts.push(waiting(self.pose_sigma));
        if self.map.is_none() {
            self.verdicts[index].status = Status::Accepted;
            let alone = std::iter::once((&sample, robot));
            self.map = Some(Sample::map_of(alone, sample.target_spacing));
            self.samples.push(sample);
            return vec![index];
        }
        self.samples.push(sample);
        let mut changed = vec![index];
        if self.try_to_place(index) {
            changed.extend(self.retry());
        } else if let Some(partner) = self.pair_up(index) {
            changed.push(partner);
            changed.extend(self.retry());
        }
        changed
    }

    /// Looks for a scan that waits as `index` does, and which it fits: the two join together, where the robot puts the
    /// one that came first. Otherwise nothing could be built on a first scan that nothing else overlaps with.
    /// The thesis has each wait for the first scan's map.
    fn pair_up(&mut self, index: usize) -> Option<usize> {
        if self.params.method == Method::Thesis {
            return None;
        }
        let prior = Prior::of(&self.robot[index], self.pose_sigma);
        let partner = (0..index).rev().filter(|&i| self.verdicts[i].status == Status::Deferred);
        let (partner, pose, verdict) = partner.take(PARTNERS).find_map(|i| {
            let alone = std::iter::once((&self.samples[i], &self.robot[i]));
            let map = Sample::map_of(alone, self.samples[0].target_spacing);
            let (pose, verdict) = place(&self.samples[index], &map, &prior, &self.params);
            (verdict.status == Status::Accepted).then_some((i, pose, verdict))
        })?;
        let alone = Verdict {
            reason: format!("stands where the robot put it; scan {index} is aligned to it"),
            ..Verdict::first(&self.pose_sigma.information())
        };
        self.accept(partner, self.robot[partner], alone);
        self.accept(index, pose, verdict);
        Some(partner)
    }

    fn accept(&mut self, index: usize, pose: Pose, verdict: Verdict) {
        if let Some(map) = &mut self.map {
            self.samples[index].add_to(map, &pose);
        }
        self.poses[index] = pose;
        self.verdicts[index] = verdict;
    }

    /// Tries all that were put aside until none can be placed.
    fn retry(&mut self) -> Vec<usize> {
        let mut placed = Vec::new();
        loop {
            let waiting: Vec<usize> = (0..self.samples.len())
                .filter(|&i| self.verdicts[i].status == Status::Deferred)
                .filter(|&i| self.tries[i] < self.params.max_rounds)
                .collect();
            let found: Vec<usize> = waiting.into_iter().filter(|&i| self.try_to_place(i)).collect();
            if found.is_empty() {
                return placed;
            }
            placed.extend(found);
        }
    }

    fn try_to_place(&mut self, index: usize) -> bool {
        let Some(map) = &self.map else { return false };
        self.tries[index] += 1;
        let prior = Prior::of(&self.robot[index], self.pose_sigma);
        let (pose, verdict) = place(&self.samples[index], map, &prior, &self.params);
        let accepted = verdict.status == Status::Accepted;
        if accepted {
            self.accept(index, pose, verdict);
        } else {
            self.verdicts[index] = verdict;
        }
        accepted
    }

    /// Registers all scans anew and together, as [`super::register`] does; the result is what counts from now on.
    ///
    /// # Errors
    /// As [`super::register`].
    pub fn refine(&mut self, progress: &Progress) -> Result<Registration> {
        let registration =
            register_samples(&self.samples, &self.robot, self.pose_sigma, &self.params, progress)?;
        self.adopt(&registration);
        Ok(registration)
    }

    /// Goes on from a registration of all scans taken; one of another number of scans is passed over.
    pub fn adopt(&mut self, registration: &Registration) {
        if registration.poses.len() != self.samples.len() || self.samples.is_empty() {
            return;
        }
        self.poses.clone_from(&registration.poses);
        self.verdicts.clone_from(&registration.verdicts);
        let accepted = self.verdicts.iter().map(|verdict| verdict.status == Status::Accepted);
        let scans = self.samples.iter().zip(&self.poses).zip(accepted);
        let placed = scans.filter_map(|(placed, accepted)| accepted.then_some(placed));
        self.map = Some(Sample::map_of(placed, self.samples[0].target_spacing));
    }
}
