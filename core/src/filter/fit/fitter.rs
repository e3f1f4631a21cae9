//! The fit of a surface to the measurements near a seed.

use super::quadric::{Fit, Measured, fit_quadric};
use crate::filter::params::FilterParams;
use crate::filter::pooled::PooledMeasurements;
use crate::geometry::{NoiseComponents, Vec3, median};

/// Least share of the measurements near a seed that must agree with its surface.
const MIN_AGREEMENT_RATIO: f64 = 0.35;
/// Residuals whose variance within the scans exceeds that of the noise by this factor come from a
/// surface that is no quadric over the radius, such as an edge. It is then fitted within smaller
/// and smaller radii.
const MAX_MISFIT_RATIO: f64 = 1.4;
/// A misfit counts only if it exceeds chance by this many standard deviations.
const MIN_MISFIT_SIGMAS: f64 = 4.0;
/// Smallest radius in standard deviations of the measurements; within a smaller one the fitted
/// surface would tilt.
pub(crate) const MIN_RADIUS_SIGMAS: f64 = 4.0;
/// Measurements that a reduced radius must hold, in multiples of those that support a point.
const REDUCED_RADIUS_SUPPORT: usize = 4;
/// Standard deviations along the normal within which measurements belong to the surface of a seed.
/// The depth is limited to the radius.
const MAX_DEPTH_SIGMAS: f64 = 14.0;
/// A surface that lies farther from the seed than this share of the radius, or whose normal has
/// less than this cosine with the start normal, is fitted again about its foot point: what lies
/// within reach of a noisy seed leans towards the seed.
const MAX_SEED_OFFSET_RATIO: f64 = 0.1;
const MIN_SETTLED_NORMAL_COS: f64 = 0.99;
/// Largest distance of the surface from the seed, in noise radii.
const MAX_FOOT_OFFSET_RATIO: f64 = 0.7;
/// The reduced radii, in noise radii.
const REDUCED_RADIUS_RATIOS: [f64; 2] = [0.6, 0.36];

/// What all fits share.
pub(crate) struct Fitter<'a> {
    pooled: &'a PooledMeasurements,
    /// The noise radius, metres.
    radius: f64,
    /// How far from the seed along the normal a measurement may lie that belongs, metres.
    depth: f64,
    params: &'a FilterParams,
    noise: NoiseComponents,
}

/// The measurements that a fit may use, and how many of them it needs.
struct Candidates<'a> {
    near: &'a [usize],
    /// Radius of the cylinder about the normal, metres.
    radius: f64,
    min_measurements: usize,
}

impl<'a> Fitter<'a> {
    /// Fits within `radius` (metres) to measurements whose noise consists of `noise`.
    pub(crate) fn new(
        pooled: &'a PooledMeasurements,
        radius: f64,
        params: &'a FilterParams,
        noise: NoiseComponents,
    ) -> Fitter<'a> {
        let median_sigma =
            median(pooled.sigma.iter().map(|s| f64::from(*s)).collect()).unwrap_or(0.0);
        let depth = (MAX_DEPTH_SIGMAS * median_sigma * noise.total().sqrt()).min(radius);
        Fitter { pooled, radius, depth, params, noise }
    }

    /// The surface at the measurement `seed`, if enough measurements agree on one; within a smaller
    /// radius where the surface bends.
    pub(crate) fn fit(&self, seed: usize) -> Option<Fit> {
        let near = self.find_near(seed);
        let mut best = self.fit_within(seed, &near, 1.0)?;
        let noise = f64::from(self.pooled.sigma[seed]) * self.noise.total().sqrt();
        for share in REDUCED_RADIUS_RATIOS {
            if !self.is_misfit(&best) || share * self.radius < MIN_RADIUS_SIGMAS * noise {
                break;
            }
            match self.fit_within(seed, &near, share) {
                Some(fit) if self.misfit_ratio(&fit) < self.misfit_ratio(&best) => best = fit,
                _ => break,
            }
        }
        Some(best)
    }

    /// The surface at the measurement `seed` within the whole radius.
    pub(crate) fn fit_whole_radius(&self, seed: usize) -> Option<Fit> {
        self.fit_within(seed, &self.find_near(seed), 1.0)
    }

    fn misfit_ratio(&self, fit: &Fit) -> f64 {
        fit.moments.misfit(&self.noise).variance_ratio
    }

    fn is_misfit(&self, fit: &Fit) -> bool {
        let misfit = fit.moments.misfit(&self.noise);
        misfit.sigmas > MIN_MISFIT_SIGMAS && misfit.variance_ratio > MAX_MISFIT_RATIO
    }

    /// The measurements within a sphere that contains the cylinder about the seed, whatever its
    /// axis is. The cylinder is so deep that noise does not decide which measurements belong to it.
    fn find_near(&self, seed: usize) -> Vec<usize> {
        let (points, mut near) = (&self.pooled.points, Vec::new());
        let search = self.radius.hypot(self.depth);
        self.pooled.cells.for_each_within(points, &points[seed], search, |i, _| near.push(i));
        near
    }

    /// The surface at `seed` from those of `near` within the share `share` of the radius.
    fn fit_within(&self, seed: usize, near: &[usize], share: f64) -> Option<Fit> {
        let (pooled, radius) = (self.pooled, self.radius * share);
        let point = pooled.points[seed];
        let cosine = self.params.max_normal_angle.cos();
        let normal = self.mean_normal(seed, near, radius, cosine)?;
        let factor = if share < 1.0 { REDUCED_RADIUS_SUPPORT } else { 1 };
        let min_measurements = factor * self.params.min_measurements;
        let candidates = Candidates { near, radius, min_measurements };
        let (mut fit, mut count) = self.fit_about(&candidates, &point, &normal)?;
        if (fit.point - point).norm() > MAX_SEED_OFFSET_RATIO * radius
            || fit.normal.dot(&normal) < MIN_SETTLED_NORMAL_COS
        {
            (fit, count) = self.fit_about(&candidates, &fit.point, &fit.normal)?;
        }
        let moved = (fit.point - point).norm();
        let is_supported = fit.effective >= self.params.min_measurements as f64 / 2.0
            && fit.effective >= MIN_AGREEMENT_RATIO * count as f64
            && moved < MAX_FOOT_OFFSET_RATIO * self.radius
            && fit.normal.dot(&normal) > cosine;
        // As many as there would be within the whole radius, so that supports can be compared.
        fit.effective /= share * share;
        is_supported.then_some(fit)
    }

    /// The surface about `center` with start normal `normal`, and the number of measurements that
    /// it was fitted to; `None` if there are too few.
    fn fit_about(
        &self,
        candidates: &Candidates,
        center: &Vec3,
        normal: &Vec3,
    ) -> Option<(Fit, usize)> {
        let measured = self.in_cylinder(candidates, center, normal);
        if measured.len() < candidates.min_measurements {
            return None;
        }
        let fit = fit_quadric(&measured, center, normal, candidates.radius, &self.noise)?;
        Some((fit, measured.len()))
    }

    /// The candidates on the side of `normal`, within the radius of `center` along the surface.
    fn in_cylinder(&self, candidates: &Candidates, center: &Vec3, normal: &Vec3) -> Vec<Measured> {
        let (pooled, cosine) = (self.pooled, self.params.max_normal_angle.cos());
        let radius_squared = candidates.radius * candidates.radius;
        let mut measured = Vec::new();
        for &i in candidates.near {
            let offset = pooled.points[i] - center;
            let height = offset.dot(normal);
            if pooled.normals[i].dot(normal) >= cosine
                && offset.norm_squared() - height * height <= radius_squared
                && height.abs() <= self.depth
            {
                measured.push(Measured {
                    point: pooled.points[i],
                    scan: pooled.scan[i],
                    sigma: f64::from(pooled.sigma[i]),
                });
            }
        }
        measured
    }

    /// The mean of the normals within `radius` of the seed on its side (cosine at least `cosine`),
    /// twice, so that the seed's own normal matters little.
    fn mean_normal(&self, seed: usize, near: &[usize], radius: f64, cosine: f64) -> Option<Vec3> {
        let pooled = self.pooled;
        let center = pooled.points[seed];
        let normals: Vec<Vec3> = near
            .iter()
            .filter(|&&i| (pooled.points[i] - center).norm_squared() <= radius * radius)
            .map(|&i| pooled.normals[i])
            .collect();
        (0..2).try_fold(pooled.normals[seed], |axis, _| {
            normals.iter().filter(|n| n.dot(&axis) >= cosine).sum::<Vec3>().try_normalize(0.0)
        })
    }
}
