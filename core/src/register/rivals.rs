//! Other poses that fit as well: ribs, teeth and corners repeat themselves.
//!
//! Starts are spread over what the prior allows, one to either side along each of its axes. A start that comes to rest
//! elsewhere, at a pose that the result's covariance does not explain, and is not much less likely, makes the result
//! ambiguous: more points on the surface speak for a pose, a distance from where the prior believes it against.

use super::RegisterParams;
use super::align::{Map, Moving, Prior, Radius, align, correspondences};
use super::sample::Sample;
use super::verdict::chi;
use crate::geometry::{Mat6, Pose, exp, log};
use nalgebra::SymmetricEigen;
use rayon::prelude::*;

/// A prior that lets the points go astray by less than this share of a scan's size has no room for rivals.
const CERTAIN: f64 = 0.05;
/// How far off the starts lie, in standard deviations of the prior.
const OFFSET: f64 = 1.5;
/// Every so many of a scan's points take part: a rival need not be found exactly.
const STRIDE: usize = 4;
/// What the points say counts like so many independent measurements: neighbours share their noise.
const INDEPENDENT: f64 = 20.0;
/// From these odds against the result a pose is as good; from the inverse on it is better.
const ODDS: f64 = 0.04;
/// Mahalanobis distance within which two poses are the same.
const SAME: f64 = 5.0;

/// A pose that is about as good as the result, or better.
pub(crate) struct Rival {
    pub pose: Pose,
    pub better: bool,
}

/// Looks for rivals of a scan's pose on the map.
pub(crate) struct Rivals<'a> {
    pub sample: &'a Sample,
    pub map: &'a Map,
    pub prior: &'a Prior,
    pub radius: Radius,
    pub params: &'a RegisterParams,
}

impl Rivals<'_> {
    /// The best rival of `found`, which has the covariance `covariance`; `None` also where the prior is certain.
    pub(crate) fn of(&self, found: &Pose, covariance: &Mat6) -> Option<Rival> {
        let sample = self.sample;
        if sample.moved_by(&self.prior.information) < CERTAIN * sample.extent {
            return None;
        }
        let certain = covariance.try_inverse()?;
        let noise = sample.noise * std::f64::consts::SQRT_2;
        let thin = sample.every(STRIDE);
        let moving = thin.moving(noise);
        let near = 3.0 * noise;
        let log_posterior = |pose: &Pose| {
            let matched = correspondences(&moving, self.map, pose, self.radius.end, self.params);
            let fit = matched.iter().filter(|c| c.distance.abs() < near).count() as f64;
            INDEPENDENT * fit.ln() - 0.5 * self.prior.off_squared(pose)
        };
        let at_rest = |start: &Pose| {
            let pose = self.released(&moving, start);
            let apart = log(&(found.inverse() * pose));
            let other = apart.dot(&(certain * apart)).sqrt() > SAME
                && sample.displacement(found, &pose) > 2.0 * self.radius.end;
            let allowed = self.prior.off_squared(&pose).sqrt() < chi(self.params.max_correction);
            (allowed && other).then(|| (pose, log_posterior(&pose)))
        };
        let tried: Vec<Option<(Pose, f64)>> = self.starts().par_iter().map(at_rest).collect();
        let best = tried.into_iter().flatten().max_by(|a, b| a.1.total_cmp(&b.1))?;
        let odds = (best.1 - log_posterior(found)).exp();
        (odds >= ODDS).then_some(Rival { pose: best.0, better: odds > 1.0 / ODDS })
    }

    /// Where the scan comes to rest from `start`, held loosely there.
    fn released(&self, moving: &Moving, start: &Pose) -> Pose {
        let loose = Prior { pose: *start, information: self.prior.information / 4.0 };
        align(moving, self.map, &loose, self.radius, self.params).pose
    }

    fn starts(&self) -> Vec<Pose> {
        let eigen = SymmetricEigen::new(self.prior.information);
        (0..12)
            .filter_map(|k| {
                let value = eigen.eigenvalues[k / 2];
                let side = if k % 2 == 0 { OFFSET } else { -OFFSET };
                let off = eigen.eigenvectors.column(k / 2) * (side / value.sqrt());
                (value > 0.0).then(|| self.prior.pose * exp(&off))
            })
            .collect()
    }
}
