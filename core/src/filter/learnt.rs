//! The noise of all scans, from how their measurements lie about common surfaces.

use super::FilterParams;
use super::fitter::Fitter;
use super::merged::{LEAST_SIGMA, Merged};
use super::quadric::Fit;
use super::weighted::seeds;
use crate::geometry::{Components, Moments, NoiseModel, Residual};
use rayon::prelude::*;

/// Seeds from whose fits the noise is learnt.
const LEARNERS: usize = 2000;
/// Measurements this near to a seed, in noise radii, are held against the plane there: no curvature counts.
const NEAR: f64 = 0.35;

/// What was learnt.
pub(super) struct Learnt {
    /// What a scan's own standard deviations are to be multiplied with, by range and incidence.
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

/// Distances of measurements from the surfaces next to them, in stated standard deviations.
fn residuals(merged: &Merged, fits: &[Fit], noise_radius: f64) -> Vec<Residual> {
    let cells = crate::voxel::CellIndex::new(&merged.points, noise_radius);
    let near = |fit: &Fit| {
        let mut found = Vec::new();
        cells.for_each_within(&merged.points, &fit.point, noise_radius, |i, square| {
            let height = (merged.points[i] - fit.point).dot(&fit.normal);
            let aside = square - height * height;
            if merged.normals[i].dot(&fit.normal) > 0.0 && aside < (NEAR * noise_radius).powi(2) {
                found.push(Residual {
                    range: f64::from(merged.range[i]),
                    cosine: merged.rays[i].dot(&fit.normal).abs(),
                    distance: height / f64::from(merged.sigma[i]),
                });
            }
        });
        found
    };
    let found: Vec<Vec<Residual>> = fits.par_iter().map(near).collect();
    found.concat()
}
