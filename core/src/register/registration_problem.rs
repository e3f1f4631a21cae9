//! The registration of all scans together: the two stages of Wiedemann 2014, §2.3.1 (align each
//! scan to the map, then try the deferred ones again), and the joint optimisation.

use super::align::{Map, Prior, correspondences};
use super::joint::{Start, optimise};
use super::judge::{Status, Verdict, relocalize};
use super::registration::Registration;
use super::registration_scan::RegistrationScan;
use super::scan_registration::register_scan;
use super::strategy::Strategy;
use crate::geometry::Pose;
use crate::scan::PoseSigma;
use crate::{Progress, Result};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::f64::consts::SQRT_2;

/// Every eighth point of a scan takes part in the count of its overlap with the map.
const OVERLAP_STRIDE: usize = 8;
/// Standard deviations of the robot's poses within which overlap is searched.
const OVERLAP_SIGMAS: f64 = 3.0;

/// The scans of one object and what is known of their poses.
#[derive(Clone, Copy)]
pub(crate) struct RegistrationProblem<'a> {
    /// At least one.
    pub scans: &'a [&'a RegistrationScan],
    /// The robot's poses `object_from_sensor`, one a scan.
    pub robot: &'a [Pose],
    /// Standard deviation of the robot's poses.
    pub pose_sigma: PoseSigma,
    pub strategy: &'a Strategy,
    pub progress: &'a Progress,
}

impl RegistrationProblem<'_> {
    /// Registers all scans.
    ///
    /// # Errors
    /// [`crate::Error::Input`] if the joint optimisation is singular; [`crate::Error::Cancelled`].
    pub(crate) fn solve(&self) -> Result<Registration> {
        let mut registration = self.register_in_two_stages()?;
        if self.strategy.joint {
            self.optimise(&mut registration, Start::Coarse)?;
            // The first scans' errors had moved the map away from the priors, which is undone now:
            // scans that were refused for that reason have another chance, and scans that converged
            // to a wrong minimum are moved.
            let mut joined = self.register_remaining(&mut registration)?;
            joined += self.register_tied(&mut registration)?;
            let moved = relocalize(self.scans, self.robot, &mut registration, self.strategy);
            if moved + joined > 0 {
                self.optimise(&mut registration, Start::Fine)?;
            }
        }
        registration.update_residual(self.scans, &self.strategy.params);
        Ok(registration)
    }

    fn optimise(&self, registration: &mut Registration, start: Start) -> Result<()> {
        let params = &self.strategy.params;
        optimise(self.scans, self.robot, registration, start, params, self.progress)
    }

    /// Aligns all scans to the first and to those accepted before them; where few can join the
    /// first, to the one that most others overlap with. Scans that no round could register are
    /// refused and keep the robot's pose.
    fn register_in_two_stages(&self) -> Result<Registration> {
        let (joined, registration) = self.register_to(0)?;
        if !self.strategy.may_start_elsewhere || 2 * (joined + 1) >= self.scans.len() {
            return Ok(registration);
        }
        // The first scan shares too little with the others for them to join it.
        let (more, other) = self.register_to(self.scan_with_most_overlap())?;
        Ok(if more > joined { other } else { registration })
    }

    /// Registers all scans, scan `first` defining the map; also returns how many others joined.
    fn register_to(&self, first: usize) -> Result<(usize, Registration)> {
        let deferred = Verdict::deferred(&self.pose_sigma.information());
        let mut verdicts = vec![deferred; self.scans.len()];
        verdicts[first].status = Status::Accepted;
        let mut registration = Registration {
            poses: self.robot.to_vec(),
            verdicts,
            pose_sigma: self.pose_sigma,
            residual: None,
        };
        let joined = self.register_remaining(&mut registration)?;
        Ok((joined, registration))
    }

    /// The scan that the others overlap with most if the robot's poses are right; the first of
    /// several.
    fn scan_with_most_overlap(&self) -> usize {
        (0..self.scans.len())
            .into_par_iter()
            .map(|i| (self.overlap_of_others(i), Reverse(i)))
            .max()
            .map_or(0, |(_, Reverse(i))| i)
    }

    /// Points of the other scans that overlap with scan `center`.
    fn overlap_of_others(&self, center: usize) -> usize {
        let map = self.scans[center].own_map(&self.robot[center], self.voxel());
        let others = (0..self.scans.len()).filter(|&i| i != center);
        others.map(|i| self.overlap(i, &map)).sum()
    }

    /// Sampled points of scan `index` that lie near the map with a similar normal if the robot's
    /// pose is right.
    fn overlap(&self, index: usize, map: &Map) -> usize {
        let scan = self.scans[index];
        // The error of the map adds to that of the scan.
        let pose_reach = OVERLAP_SIGMAS * SQRT_2 * self.pose_sigma.point_sigma(scan.distance);
        let reach = pose_reach.max(scan.map_spacing);
        let subset = scan.every(OVERLAP_STRIDE);
        let source = subset.source(scan.noise);
        correspondences(&source, map, &self.robot[index], reach, self.strategy).len()
    }

    /// Edge of the map's voxels, metres.
    fn voxel(&self) -> f64 {
        self.scans[0].map_spacing
    }

    /// Registers scans that fit each of the others alone, but not all of them, and returns how many
    /// joined. Two scans that share a face are put together in the directions that it holds, and
    /// stay where the robot says in the others. A third that shares faces with both ties them in
    /// these directions too, but with the poses so far it fits one of them only. So all are
    /// optimised together first; each must then lie on the surface of those accepted before.
    fn register_tied(&self, registration: &mut Registration) -> Result<usize> {
        let candidates: Vec<usize> = (0..self.scans.len())
            .filter(|&i| self.has_enough_overlap(&registration.verdicts[i]))
            .collect();
        if candidates.is_empty() {
            return Ok(0);
        }
        let mut tied = registration.clone();
        for &i in &candidates {
            tied.verdicts[i].status = Status::Accepted;
        }
        self.optimise(&mut tied, Start::Coarse)?;
        for &i in &candidates {
            tied.verdicts[i].status = Status::Refused;
            tied.poses[i] = self.robot[i];
        }
        let joined = self.register_remaining(&mut tied)?;
        if joined == 0 {
            return Ok(0);
        }
        if joined < candidates.len() {
            // Scans that did not join had drawn the others away.
            self.optimise(&mut tied, Start::Coarse)?;
        }
        *registration = tied;
        Ok(joined)
    }

    /// Whether a scan that is not accepted overlaps enough to be registered.
    fn has_enough_overlap(&self, verdict: &Verdict) -> bool {
        !verdict.is_accepted()
            && verdict.overlap >= self.strategy.params.min_overlap
            && verdict.correspondences >= self.strategy.params.min_correspondences
    }

    /// Tries to register all scans that are not accepted, each time the one that overlaps most with
    /// the map; one that fails is deferred until the map has grown, at most `max_rounds` times.
    /// Scans that could not be registered are refused. Returns how many joined.
    fn register_remaining(&self, registration: &mut Registration) -> Result<usize> {
        let (accepted, mut waiting): (Vec<usize>, Vec<usize>) =
            (0..self.scans.len()).partition(|&i| registration.verdicts[i].is_accepted());
        let placed = accepted.iter().map(|&i| (self.scans[i], &registration.poses[i]));
        let mut map = RegistrationScan::map_of(placed, self.voxel());
        let mut trials = vec![0; self.scans.len()];
        let mut joined = 0;
        loop {
            let order = self.by_overlap(&waiting, &trials, &map);
            let mut found = None;
            for i in order {
                let done = (accepted.len() + joined) as f64 / self.scans.len() as f64;
                self.progress.report("register", done)?;
                trials[i] += 1;
                let prior = Prior::relative_to_map(&self.robot[i], self.pose_sigma);
                let (pose, verdict) = register_scan(self.scans[i], &map, &prior, self.strategy);
                let is_accepted = verdict.is_accepted();
                registration.verdicts[i] = verdict;
                if is_accepted {
                    registration.poses[i] = pose;
                    found = Some(i);
                    break;
                }
            }
            let Some(i) = found else { break };
            self.scans[i].add_to(&mut map, &registration.poses[i]);
            waiting.retain(|&j| j != i);
            joined += 1;
        }
        for i in waiting {
            registration.verdicts[i].status = Status::Refused;
        }
        Ok(joined)
    }

    /// The waiting scans that may still be tried, the one that overlaps most with the map first.
    fn by_overlap(&self, waiting: &[usize], trials: &[usize], map: &Map) -> Vec<usize> {
        let mut order: Vec<(Reverse<usize>, usize)> = waiting
            .iter()
            .filter(|&&i| trials[i] < self.strategy.params.max_rounds)
            .map(|&i| (Reverse(self.overlap(i, map)), i))
            .collect();
        order.sort();
        order.into_iter().map(|(_, i)| i).collect()
    }
}
