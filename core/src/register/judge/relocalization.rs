//! Moves scans that converged to a wrong minimum, once all scans are registered.
//!
//! A scan was aligned when the map held only the scans before it, with their errors, and may have
//! converged a rim or a rib away from where it belongs; the joint optimisation does not leave such
//! a minimum. For scans whose geometry had left a direction to the prior, starts are drawn from the
//! prior, and against the map of all others the pose is taken that is the most probable: that with
//! the least
//!
//! ```text
//! s sum_i rho(r_i / sigma) + d^T P d / 2          (1)
//! ```
//!
//! with Tukey's rho of the point-to-plane residuals, the share s of them that is independent, and
//! the correction d of the robot's pose with its information P.

use crate::geometry::{Mat6, Pose, Twist, exp};
use crate::register::align::factors::tukey_loss;
use crate::register::align::{Map, Prior, SearchRadius, Source, align, correspondences};
use crate::register::params::RegisterParams;
use crate::register::registration::Registration;
use crate::register::registration_scan::RegistrationScan;
use crate::register::strategy::Strategy;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

/// Starts for each scan.
const START_COUNT: usize = 10;
/// Only every fourth point of the scan takes part in the search for minima.
const POINT_STRIDE: usize = 4;
/// Iterations that show which minimum a start leads to.
const SEARCH_ITERATIONS: usize = 10;
/// A pose must have a smaller (1) by this, a factor of 3000 in probability: the map's own noise
/// makes minima.
const MIN_COST_GAIN: f64 = 8.0;
/// Motion of the points that the prior allows, in its standard deviations.
const PRIOR_MOTION_SIGMA: f64 = 3.0;
/// Search radius at the start, in search radii at the end.
const START_RADIUS_RATIO: f64 = 2.0;
/// Information of the start's pose as a share of the prior's: the start holds the scan by twice the
/// standard deviation, so that it may move to the nearest minimum.
const START_INFORMATION_SHARE: f64 = 0.25;

/// Moves accepted scans to where they are clearly more probable. Returns how many were moved.
pub(crate) fn relocalize(
    scans: &[&RegistrationScan],
    robot: &[Pose],
    registration: &mut Registration,
    strategy: &Strategy,
) -> usize {
    let accepted = registration.accepted();
    let information = registration.pose_sigma.information();
    let examined: Vec<usize> = accepted
        .iter()
        .copied()
        .filter(|&i| {
            !registration.verdicts[i].free_directions.is_empty()
                && may_be_elsewhere(scans[i], &information)
        })
        .collect();
    let before: &Registration = registration;
    let moved: Vec<(usize, Pose)> = examined
        .par_iter()
        .filter_map(|&own| {
            let others = accepted.iter().filter(|&&i| i != own);
            let placed = others.map(|&i| (scans[i], &before.poses[i]));
            let map = RegistrationScan::map_of(placed, scans[0].map_spacing);
            let prior = Prior { pose: robot[own], information };
            let relocalizer = Relocalizer { scan: scans[own], map: &map, prior, strategy };
            relocalizer.find_better(&before.poses[own]).map(|pose| (own, pose))
        })
        .collect();
    for (i, pose) in &moved {
        registration.poses[*i] = *pose;
    }
    moved.len()
}

/// Whether the prior allows a scan to leave the reach of its surface; otherwise there is no other
/// place for it.
fn may_be_elsewhere(scan: &RegistrationScan, prior_information: &Mat6) -> bool {
    PRIOR_MOTION_SIGMA * scan.moved_by(prior_information) > scan.reach(scan.noise)
}

/// Searches for the most probable pose of one scan on the map of all others.
struct Relocalizer<'a> {
    scan: &'a RegistrationScan,
    map: &'a Map,
    prior: Prior,
    strategy: &'a Strategy,
}

impl Relocalizer<'_> {
    /// A pose that is clearly more probable than `current`.
    fn find_better(&self, current: &Pose) -> Option<Pose> {
        let subset = self.scan.every(POINT_STRIDE);
        let source = subset.source(self.noise());
        let (cost, best) = self
            .starts()
            .iter()
            .map(|start| self.converge_from(&source, start, SEARCH_ITERATIONS))
            .map(|pose| (self.cost(&source, &pose), pose))
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        if cost > self.cost(&source, current) {
            return None;
        }
        let all_points = self.scan.source(self.noise());
        let pose = self.converge_from(&all_points, &best, self.strategy.params.max_iterations);
        let max_cost = self.cost(&all_points, current) - MIN_COST_GAIN;
        (self.cost(&all_points, &pose) < max_cost).then_some(pose)
    }

    /// The robot's pose and others, drawn from the prior.
    fn starts(&self) -> Vec<Pose> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.strategy.params.seed as u64);
        let covariance = self.prior.information.try_inverse().and_then(|c| c.cholesky());
        let root = covariance.map_or_else(Mat6::zeros, |c| c.l());
        let mut starts = vec![self.prior.pose];
        for _ in 1..START_COUNT {
            let deviate = Twist::from_fn(|_, _| rng.sample(StandardNormal));
            starts.push(self.prior.pose * exp(&(root * deviate)));
        }
        starts
    }

    /// The pose that the points converge to from `start`, held loosely there.
    fn converge_from(&self, source: &Source, start: &Pose, max_iterations: usize) -> Pose {
        let end = self.scan.reach(self.noise());
        let radius = SearchRadius { start: START_RADIUS_RATIO * end, end };
        let information = self.prior.information * START_INFORMATION_SHARE;
        let prior = Prior { pose: *start, information };
        let params = RegisterParams { max_iterations, ..self.strategy.params.clone() };
        let strategy = Strategy { params, ..self.strategy.clone() };
        align(source, self.map, &prior, radius, &strategy).pose
    }

    /// (1) at a pose; the points of `source` count for all points of the scan.
    fn cost(&self, source: &Source, pose: &Pose) -> f64 {
        let reach = self.scan.reach(self.noise());
        let found = correspondences(source, self.map, pose, reach, self.strategy);
        let near: f64 = found.iter().map(|c| tukey_loss(c.plane_distance / self.noise())).sum();
        let missed = (source.points.len() - found.len()) as f64 * tukey_loss(f64::INFINITY);
        let each = self.scan.points.len() as f64 / source.points.len().max(1) as f64;
        self.strategy.params.information_share * each * (near + missed)
            + self.prior.mahalanobis_squared(pose) / 2.0 // (1)
    }

    /// Noise of the scan and of the map together, metres.
    fn noise(&self) -> f64 {
        self.scan.noise * std::f64::consts::SQRT_2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Vec3, log};
    use crate::register::sharp_shapes_tests::{even_views, shape, simulate_scan};
    use crate::scan::{PoseSigma, PreparedScan};

    const SIGMA: PoseSigma = PoseSigma { translation: 4e-3, rotation: 1e-2 };

    /// A scan of a wedge from `pose`.
    fn scan_from(pose: &Pose, seed: u64, strategy: &Strategy) -> RegistrationScan {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let scan = simulate_scan(&shape("wedge"), pose, 1.6e-3, 5e-5, &mut rng);
        RegistrationScan::new(&PreparedScan::new(&scan).unwrap(), SIGMA, strategy)
    }

    #[test]
    fn the_truth_is_more_probable_than_a_displaced_pose_and_is_found_from_there() {
        let strategy = Strategy::new(&RegisterParams::default());
        // The view that sees the slope and two other faces.
        let direction = Vec3::new(0.6, -0.5, 0.6);
        let views = even_views(20);
        let pose = *views
            .iter()
            .max_by(|a, b| {
                let [a, b] = [a, b].map(|pose| pose.translation.vector.dot(&direction));
                a.total_cmp(&b)
            })
            .unwrap();
        let [scan, other] = [1, 2].map(|seed| scan_from(&pose, seed, &strategy));
        let map = RegistrationScan::map_of(std::iter::once((&other, &pose)), other.map_spacing);
        let prior = Prior {
            pose: pose * exp(&Twist::new(3e-3, -2e-3, 1e-3, 5e-3, 0.0, -5e-3)),
            information: SIGMA.information(),
        };
        let relocalizer = Relocalizer { scan: &scan, map: &map, prior, strategy: &strategy };
        let source = scan.source(relocalizer.noise());
        let wrong = pose * exp(&Twist::new(-6e-3, 5e-3, 0.0, 0.0, 2e-2, 1e-2));
        let [best, worse] = [pose, wrong].map(|pose| relocalizer.cost(&source, &pose));
        assert!(best < worse - MIN_COST_GAIN, "{best} {worse}");
        let found = relocalizer.find_better(&wrong).unwrap();
        assert!(log(&(pose.inverse() * found)).norm() < 2e-3, "{found}");
        assert!(relocalizer.find_better(&found).is_none());
    }

    #[test]
    fn starts_are_the_prior_and_draws_of_its_spread() {
        let strategy = Strategy::new(&RegisterParams::default());
        let pose = even_views(1)[0];
        let scan = scan_from(&pose, 1, &strategy);
        let map = RegistrationScan::map_of(std::iter::once((&scan, &pose)), scan.map_spacing);
        let prior = Prior { pose, information: SIGMA.information() };
        let relocalizer = Relocalizer { scan: &scan, map: &map, prior, strategy: &strategy };
        let starts = relocalizer.starts();
        assert_eq!((starts.len(), starts[0]), (START_COUNT, pose));
        // Of six dimensions each: a chi-square of 54 degrees of freedom, 54 +- 10.
        let sum: f64 = starts.iter().map(|start| prior.mahalanobis_squared(start)).sum();
        assert!((24.0..94.0).contains(&sum), "{sum}");
    }
}
