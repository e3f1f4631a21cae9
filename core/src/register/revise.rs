//! A second look at each scan once all stand together.
//!
//! A scan was placed when the map held only those before it, with their errors, and may have come to rest a rim or a rib
//! away from where it belongs; the joint optimisation does not leave such a minimum. Where the geometry had left it to
//! the prior, starts are drawn from what the prior allows, and against the map of all others the pose is taken that is
//! the most probable, that with the least
//!
//! ```text
//! s sum_i rho(r_i / sigma) + d^T P d / 2                                                         (1)
//! ```
//!
//! with Tukey's rho of the point-to-plane residuals, the share s of them that is independent, and the correction d of
//! the robot's pose with its information P.

use super::align::{Map, Moving, Prior, Radius, align, correspondences};
use super::factors::tukey_loss;
use super::sample::Sample;
use super::verdict::Status;
use super::{RegisterParams, Registration};
use crate::geometry::{Mat6, Pose, Twist, exp};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

/// Starts for each scan.
const STARTS: usize = 10;
/// Every so many of a scan's points look for minima.
const STRIDE: usize = 4;
/// Iterations that show to which minimum a start leads.
const ROUGHLY: usize = 10;
/// A pose must be better by so much in (1), a factor of 3000 in probability: the map's own noise makes minima.
const CLEARLY: f64 = 8.0;

/// Moves accepted scans to where they are clearly more probable; returns how many.
pub(crate) fn revise(
    samples: &[Sample],
    robot: &[Pose],
    registration: &mut Registration,
    params: &RegisterParams,
) -> usize {
    let members: Vec<usize> = (0..samples.len())
        .filter(|&i| registration.verdicts[i].status == Status::Accepted)
        .collect();
    let now: &Registration = registration;
    let information = now.pose_sigma.information();
    // A prior that holds a scan within reach of its surface leaves it no other place.
    let loose = |sample: &Sample| 3.0 * sample.moved_by(&information) > sample.reach(sample.noise);
    let open = |&&i: &&usize| !now.verdicts[i].free_directions.is_empty() && loose(&samples[i]);
    let look = |&own: &usize| -> Option<(usize, Pose)> {
        let others = members.iter().filter(|&&i| i != own);
        let placed = others.map(|&i| (&samples[i], &now.poses[i]));
        let map = Sample::map_of(placed, samples[0].target_spacing);
        let prior = Prior { pose: robot[own], information };
        let look = Look { sample: &samples[own], map: &map, prior, params };
        look.better_than(&now.poses[own]).map(|pose| (own, pose))
    };
    let looked_at: Vec<usize> = members.iter().filter(open).copied().collect();
    let found: Vec<(usize, Pose)> = looked_at.par_iter().filter_map(look).collect();
    for (i, pose) in &found {
        registration.poses[*i] = *pose;
    }
    found.len()
}

/// One scan and the map of all others.
struct Look<'a> {
    sample: &'a Sample,
    map: &'a Map,
    prior: Prior,
    params: &'a RegisterParams,
}

impl Look<'_> {
    /// A pose that is clearly more probable than `here`.
    fn better_than(&self, here: &Pose) -> Option<Pose> {
        let thin = self.sample.every(STRIDE);
        let some = thin.moving(self.noise());
        let tried = self.starts().into_iter().map(|start| self.at_rest(&some, &start, ROUGHLY));
        let (cost, best) =
            tried.map(|pose| (self.cost(&some, &pose), pose)).min_by(|a, b| a.0.total_cmp(&b.0))?;
        if cost > self.cost(&some, here) {
            return None;
        }
        let whole = self.sample.moving(self.noise());
        let pose = self.at_rest(&whole, &best, self.params.max_iterations);
        (self.cost(&whole, &pose) < self.cost(&whole, here) - CLEARLY).then_some(pose)
    }

    /// The robot's pose and others, drawn from what the prior allows.
    fn starts(&self) -> Vec<Pose> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.params.seed as u64);
        let covariance = self.prior.information.try_inverse().and_then(|c| c.cholesky());
        let root = covariance.map_or_else(Mat6::zeros, |c| c.l());
        let drawn = (1..STARTS).map(|_| {
            let deviate = Twist::from_fn(|_, _| rng.sample(StandardNormal));
            self.prior.pose * exp(&(root * deviate))
        });
        std::iter::once(self.prior.pose).chain(drawn).collect()
    }

    /// Where the points come to rest from `start`, held loosely there, after some `iterations` at most.
    fn at_rest(&self, moving: &Moving, start: &Pose, iterations: usize) -> Pose {
        let end = self.sample.reach(self.noise());
        let radius = Radius { start: 2.0 * end, end };
        let loose = Prior { pose: *start, information: self.prior.information / 4.0 };
        let params = RegisterParams { max_iterations: iterations, ..self.params.clone() };
        align(moving, self.map, &loose, radius, &params).pose
    }

    /// (1) at a pose; those of `moving` count for all points of the scan.
    fn cost(&self, moving: &Moving, pose: &Pose) -> f64 {
        let reach = self.sample.reach(self.noise());
        let found = correspondences(moving, self.map, pose, reach, self.params);
        let near: f64 = found.iter().map(|c| tukey_loss(c.distance / self.noise())).sum();
        let missed = (moving.points.len() - found.len()) as f64 * tukey_loss(f64::INFINITY);
        let each = self.sample.points.len() as f64 / moving.points.len().max(1) as f64;
        self.params.information_share * each * (near + missed) + self.prior.off_squared(pose) / 2.0
    }

    /// The scan's noise and the map's, metres.
    fn noise(&self) -> f64 {
        self.sample.noise * std::f64::consts::SQRT_2
    }
}
