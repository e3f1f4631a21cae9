//! Other poses that fit about as well: ribs, teeth and corners repeat themselves.
//!
//! Starts are spread over what the prior allows, one to either side along each of its axes. A start
//! that converges to another pose, which the result's covariance does not explain and which is not
//! much less likely, makes the result ambiguous. More points on the surface raise the likelihood of
//! a pose, its distance from the expected pose lowers it.

use super::verdict::mahalanobis_bound;
use crate::geometry::{Mat6, Pose, exp, log};
use crate::register::align::{Map, Prior, SearchRadius, Source, align, correspondences};
use crate::register::registration_scan::RegistrationScan;
use crate::register::strategy::Strategy;
use nalgebra::SymmetricEigen;
use rayon::prelude::*;

/// If the prior allows the points to move by less than this share of the scan's size, there is no
/// room for another pose.
const MIN_PRIOR_MOTION_RATIO: f64 = 0.05;
/// Distance of the starts from the expected pose, in standard deviations of the prior.
const START_OFFSET_SIGMA: f64 = 1.5;
/// Only every fourth point of the scan takes part: another pose need not be found exactly.
const POINT_STRIDE: usize = 4;
/// Independent measurements that all points together count for: neighbours share their noise.
const INDEPENDENT_MEASUREMENTS: f64 = 20.0;
/// A pose is as good as the result from these odds on; from the inverse on it is better.
const MIN_ODDS: f64 = 0.04;
/// Mahalanobis distance within which two poses are the same.
const MAX_SAME_POSE_SIGMA: f64 = 5.0;
/// Two poses are the same if they move the points by less than this many search radii.
const MAX_SAME_POSE_REACH: f64 = 2.0;
/// A point fits the surface within this many standard deviations of its residual.
const MAX_FIT_SIGMA: f64 = 3.0;
/// Information of the start's pose as a share of the prior's: the start holds the scan by twice the
/// standard deviation, so that it may move to the nearest minimum.
const START_INFORMATION_SHARE: f64 = 0.25;

/// A pose that is about as likely as the result, or more likely.
pub(crate) struct Rival {
    pub pose: Pose,
    /// Whether it is clearly more likely.
    pub better: bool,
}

/// Searches for other poses of a scan that fit the map.
pub(crate) struct AmbiguityCheck<'a> {
    pub scan: &'a RegistrationScan,
    pub map: &'a Map,
    pub prior: &'a Prior,
    pub radius: SearchRadius,
    pub strategy: &'a Strategy,
}

/// A pose with the logarithm of its posterior probability, up to a constant.
#[derive(Clone, Copy)]
struct ScoredPose {
    pose: Pose,
    log_posterior: f64,
}

impl AmbiguityCheck<'_> {
    /// The best rival of the pose `found` with this covariance; `None` also where the prior leaves
    /// no room for one.
    pub(crate) fn find_rival(&self, found: &Pose, covariance: &Mat6) -> Option<Rival> {
        let motion = self.scan.moved_by(&self.prior.information);
        if motion < MIN_PRIOR_MOTION_RATIO * self.scan.extent {
            return None;
        }
        let information = covariance.try_inverse()?;
        let subset = self.scan.every(POINT_STRIDE);
        let source = subset.source(self.scan.noise * std::f64::consts::SQRT_2);
        let scored: Vec<Option<ScoredPose>> = self
            .starts()
            .par_iter()
            .map(|start| {
                let pose = self.converge_from(&source, start);
                (self.is_allowed(&pose) && self.is_other(&pose, found, &information))
                    .then(|| ScoredPose { pose, log_posterior: self.log_posterior(&source, &pose) })
            })
            .collect();
        let best = scored
            .into_iter()
            .flatten()
            .max_by(|a, b| a.log_posterior.total_cmp(&b.log_posterior))?;
        let odds = (best.log_posterior - self.log_posterior(&source, found)).exp();
        (odds >= MIN_ODDS).then_some(Rival { pose: best.pose, better: odds > 1.0 / MIN_ODDS })
    }

    /// Whether the correction of the robot's pose is within the bound.
    fn is_allowed(&self, pose: &Pose) -> bool {
        let bound = mahalanobis_bound(self.strategy.params.max_correction);
        self.prior.mahalanobis_squared(pose).sqrt() < bound
    }

    /// Whether `pose` differs from `found` by more than its uncertainty and the search radius.
    fn is_other(&self, pose: &Pose, found: &Pose, information: &Mat6) -> bool {
        let difference = log(&(found.inverse() * pose));
        difference.dot(&(information * difference)).sqrt() > MAX_SAME_POSE_SIGMA
            && self.scan.displacement(found, pose) > MAX_SAME_POSE_REACH * self.radius.end
    }

    /// Logarithm of the posterior probability of a pose, up to a constant.
    fn log_posterior(&self, source: &Source, pose: &Pose) -> f64 {
        let matched = correspondences(source, self.map, pose, self.radius.end, self.strategy);
        let max_distance = MAX_FIT_SIGMA * source.noise;
        let fitting =
            matched.iter().filter(|c| c.plane_distance.abs() < max_distance).count() as f64;
        INDEPENDENT_MEASUREMENTS * fitting.ln() - 0.5 * self.prior.mahalanobis_squared(pose)
    }

    /// The pose that the scan converges to from `start`, held loosely there.
    fn converge_from(&self, source: &Source, start: &Pose) -> Pose {
        let information = self.prior.information * START_INFORMATION_SHARE;
        let prior = Prior { pose: *start, information };
        align(source, self.map, &prior, self.radius, self.strategy).pose
    }

    /// One start to either side along each axis of the prior.
    fn starts(&self) -> Vec<Pose> {
        let eigen = SymmetricEigen::new(self.prior.information);
        let mut starts = Vec::with_capacity(12);
        for (value, axis) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *value > 0.0 {
                for side in [START_OFFSET_SIGMA, -START_OFFSET_SIGMA] {
                    starts.push(self.prior.pose * exp(&(axis * (side / value.sqrt()))));
                }
            }
        }
        starts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Scan, Twist};
    use crate::register::params::RegisterParams;
    use crate::scan::{PoseSigma, PreparedScan};

    /// Distance between ribs, metres.
    const PITCH: f64 = 0.01;
    const NOISE: f64 = 5e-5;

    /// A plate 0.5 m away with ribs along y, and with a bump in its middle if it is to be `unique`.
    fn ribbed_plate(unique: bool) -> RegistrationScan {
        let mut points = Vec::new();
        for i in 0..120 * 90_usize {
            let (x, y) = ((i % 120) as f64 * 1e-3 - 0.06, (i / 120) as f64 * 1e-3 - 0.045);
            let mut height = 1e-3 * (x * std::f64::consts::TAU / PITCH).sin();
            if unique {
                height += 0.02 * (-(x * x + y * y) / 0.02_f64.powi(2)).exp();
            }
            // Uniform noise of standard deviation NOISE.
            let noise = NOISE * 12_f64.sqrt() * (((i * 7919) % 1009) as f64 / 1009.0 - 0.5);
            points.push([x as f32, y as f32, (0.5 - height + noise) as f32]);
        }
        let scan = PreparedScan::new(&Scan { points, ..Scan::default() }).unwrap();
        let sigma = PoseSigma { translation: 1e-2, rotation: 1e-3 };
        RegistrationScan::new(&scan, sigma, &Strategy::new(&RegisterParams::default()))
    }

    /// The best rival of the true pose of a scan on its own map, where the robot knows x by
    /// `sigma_x` (metres).
    fn rival(scan: &RegistrationScan, sigma_x: f64) -> Option<Rival> {
        let here = Pose::identity();
        let map = RegistrationScan::map_of(std::iter::once((scan, &here)), scan.map_spacing);
        let sigma = Twist::new(sigma_x, 1e-3, 1e-3, 2e-3, 2e-3, 2e-3);
        let prior = Prior {
            pose: here,
            information: Mat6::from_diagonal(&sigma.map(|sigma| 1.0 / (sigma * sigma))),
        };
        let end = scan.reach(scan.noise * std::f64::consts::SQRT_2);
        let check = AmbiguityCheck {
            scan,
            map: &map,
            prior: &prior,
            radius: SearchRadius { start: 2.0 * end, end },
            strategy: &Strategy::new(&RegisterParams::default()),
        };
        let covariance = Mat6::from_diagonal_element(1e-10);
        check.find_rival(&here, &covariance)
    }

    #[test]
    fn ribs_have_a_rival_one_pitch_away() {
        let found = rival(&ribbed_plate(false), 1e-2).unwrap();
        let shift = found.pose.translation.vector;
        let pitches = shift.x / PITCH;
        assert!((pitches - pitches.round()).abs() < 0.1 && pitches.round() != 0.0, "{shift}");
        assert!(!found.better);
    }

    #[test]
    fn there_is_no_rival_where_the_prior_or_the_shape_excludes_it() {
        assert!(rival(&ribbed_plate(false), 1e-3).is_none());
        assert!(rival(&ribbed_plate(true), 1e-2).is_none());
    }
}
