//! The noise of all scans, from how their measurements lie about common surfaces.

use super::FilterParams;
use super::fitter::Fitter;
use super::merged::{LEAST_SIGMA, Merged};
use super::quadric::Fit;
use super::seeds::seeds;
use crate::geometry::{Components, Moments, NoiseModel, Residual};
use rayon::prelude::*;
use std::f64::consts::SQRT_2;

/// Seeds from whose fits the noise is learnt.
const LEARNERS: usize = 2000;
/// Measurements this near to a seed, in noise radii, are held against the plane there: no curvature counts.
const NEAR: f64 = 0.35;
/// Residuals of so many times their median are outliers: five standard deviations.
const OUTLYING: f64 = 7.0;

/// What was learnt.
pub(super) struct Learnt {
    /// What the standard deviations that the scans state are to be multiplied with, by range and incidence.
    pub correction: NoiseModel,
    /// What the noise is then made of.
    pub components: Components,
}

impl Learnt {
    /// Learns the noise, and corrects the standard deviations of `merged`: a scan alone sees little of errors that its
    /// neighbouring measurements share.
    pub(super) fn new(
        merged: &mut Merged,
        noise_radius: f64,
        reduction_radius: f64,
        params: &FilterParams,
    ) -> Learnt {
        let all = seeds(merged, reduction_radius, params);
        let stride = all.len().div_ceil(LEARNERS).max(1);
        let some: Vec<usize> = all.into_iter().step_by(stride).collect();
        let fits = |merged: &Merged| -> Vec<Fit> {
            let fitter = Fitter::new(merged, noise_radius, params, Components::WHITE);
            let found: Vec<Option<Fit>> =
                some.par_iter().map(|&seed| fitter.fit_widely(seed)).collect();
            found.into_iter().flatten().collect()
        };
        let residuals = residuals(merged, &fits(merged), noise_radius);
        let correction =
            NoiseModel::estimate(&residuals).unwrap_or_else(|| NoiseModel::constant(1.0));
        for i in 0..merged.points.len() {
            let cosine = merged.rays[i].dot(&merged.normals[i]);
            let factor = correction.at(f64::from(merged.range[i]), cosine) as f32;
            merged.sigma[i] = (merged.sigma[i] * factor).max(LEAST_SIGMA);
        }
        let mut moments = Moments::default();
        fits(merged).iter().for_each(|fit| moments.add(&fit.moments));
        Learnt { correction, components: moments.components() }
    }
}

/// Differences of two scans' measurements of one place, in stated standard deviations over the square root of two: they
/// hold all that the scans do not share, whatever surface was fitted.
fn residuals(merged: &Merged, fits: &[Fit], noise_radius: f64) -> Vec<Residual> {
    let near = |fit: &Fit| {
        let mut found: Vec<Seen> = Vec::new();
        merged.cells.for_each_within(&merged.points, &fit.point, noise_radius, |i, square| {
            let height = (merged.points[i] - fit.point).dot(&fit.normal);
            let aside = square - height * height;
            if merged.normals[i].dot(&fit.normal) > 0.0 && aside < (NEAR * noise_radius).powi(2) {
                found.push(Seen {
                    scan: merged.scan[i],
                    aside,
                    range: f64::from(merged.range[i]),
                    cosine: merged.rays[i].dot(&fit.normal).abs(),
                    distance: height / f64::from(merged.sigma[i]),
                });
            }
        });
        pairs(found)
    };
    let found: Vec<Vec<Residual>> = fits.par_iter().map(near).collect();
    found.concat()
}

/// A measurement near the middle of a fit.
struct Seen {
    scan: u16,
    /// From the middle along the surface, square metres.
    aside: f64,
    range: f64,
    cosine: f64,
    /// From the surface in stated standard deviations.
    distance: f64,
}

/// Of each scan the measurement nearest to the middle; pairs of those that see the surface from alike.
fn pairs(mut found: Vec<Seen>) -> Vec<Residual> {
    let sizes = found.iter().map(|s| s.distance.abs()).collect();
    let Some(usual) = crate::geometry::median(sizes) else { return Vec::new() };
    found.retain(|s| s.distance.abs() <= OUTLYING * usual);
    found.sort_by(|a, b| a.scan.cmp(&b.scan).then(a.aside.total_cmp(&b.aside)));
    found.dedup_by_key(|s| s.scan);
    found.sort_by(|a, b| a.cosine.total_cmp(&b.cosine));
    let pair = |pair: &[Seen]| Residual {
        range: (pair[0].range + pair[1].range) / 2.0,
        cosine: (pair[0].cosine + pair[1].cosine) / 2.0,
        distance: (pair[0].distance - pair[1].distance) / SQRT_2,
    };
    found.chunks_exact(2).map(pair).collect()
}
