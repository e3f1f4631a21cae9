//! The fit of a surface to the measurements near a seed.

use super::FilterParams;
use super::merged::Merged;
use super::quadric::{Fit, Measured, fit};
use crate::geometry::{Components, Vec3};
use crate::voxel::CellIndex;

/// Of the measurements near a point that has a surface, at least this share agree with it.
const LEAST_AGREEMENT: f64 = 0.35;
/// Residuals whose variance within the scans is more than so many times the noise's come from a surface that is no
/// quadric over the radius: an edge. It is then fitted within smaller and smaller ones.
const MISFIT: f64 = 1.4;
/// So many standard deviations of chance must lie between.
const SURELY: f64 = 4.0;
/// A radius is at least so many standard deviations of the measurements, else the fitted surface tilts.
pub(super) const LEAST_RADIUS: f64 = 4.0;
/// Measurements that a smaller radius must hold, in those that support a point.
const DENSE: usize = 4;
/// The smaller radii, in the noise radius.
const SMALLER: [f64; 2] = [0.6, 0.36];

/// All that fits share.
pub(super) struct Fitter<'a> {
    merged: &'a Merged,
    cells: CellIndex,
    radius: f64,
    params: &'a FilterParams,
    noise: Components,
}

impl<'a> Fitter<'a> {
    pub(super) fn new(
        merged: &'a Merged,
        radius: f64,
        params: &'a FilterParams,
        noise: Components,
    ) -> Fitter<'a> {
        Fitter { merged, cells: CellIndex::new(&merged.points, radius), radius, params, noise }
    }

    /// The surface at the measurement `seed`, if enough agree on one; within a smaller radius where it bends.
    pub(super) fn fit(&self, seed: usize) -> Option<Fit> {
        let near = self.near(seed);
        let misfit = |fit: &Fit| fit.moments.misfit(&self.noise).1;
        let misfits = |fit: &Fit| {
            let (deviations, ratio) = fit.moments.misfit(&self.noise);
            deviations > SURELY && ratio > MISFIT
        };
        let mut best = self.fit_within(seed, &near, 1.0)?;
        let noise = f64::from(self.merged.sigma[seed]) * self.noise.total().sqrt();
        for share in SMALLER {
            if !misfits(&best) || share * self.radius < LEAST_RADIUS * noise {
                break;
            }
            match self.fit_within(seed, &near, share) {
                Some(fit) if misfit(&fit) < misfit(&best) => best = fit,
                _ => break,
            }
        }
        Some(best)
    }

    /// The surface at the measurement `seed` within the whole radius.
    pub(super) fn fit_widely(&self, seed: usize) -> Option<Fit> {
        self.fit_within(seed, &self.near(seed), 1.0)
    }

    fn near(&self, seed: usize) -> Vec<(usize, f64)> {
        let (points, mut near) = (&self.merged.points, Vec::new());
        self.cells.for_each_within(points, &points[seed], self.radius, |i, d| near.push((i, d)));
        near
    }

    fn fit_within(&self, seed: usize, near: &[(usize, f64)], share: f64) -> Option<Fit> {
        let (merged, radius) = (self.merged, self.radius * share);
        let point = merged.points[seed];
        let cosine = self.params.max_normal_angle.cos();
        let inside = near.iter().filter(|(_, square)| *square <= radius * radius);
        let near: Vec<usize> = inside.map(|(i, _)| *i).collect();
        let normal = mean_normal(merged, &near, &merged.normals[seed], cosine)?;
        let measured: Vec<Measured> = near
            .iter()
            .filter(|&&i| merged.normals[i].dot(&normal) >= cosine)
            .map(|&i| Measured {
                point: merged.points[i],
                scan: merged.scan[i],
                sigma: f64::from(merged.sigma[i]),
            })
            .collect();
        let enough = if share < 1.0 { DENSE } else { 1 } * self.params.min_measurements;
        if measured.len() < enough {
            return None;
        }
        let mut fit = fit(&measured, &point, &normal, radius, &self.noise)?;
        let moved = (fit.point - point).norm();
        let good = fit.effective >= self.params.min_measurements as f64 / 2.0
            && fit.effective >= LEAST_AGREEMENT * measured.len() as f64
            && moved < 0.7 * self.radius
            && fit.normal.dot(&normal) > cosine;
        // As many as there would be within the whole radius, so that support compares.
        fit.effective /= share * share;
        good.then_some(fit)
    }
}

/// Mean of the normals on the side of `start`, twice, so that the start matters little.
fn mean_normal(merged: &Merged, near: &[usize], start: &Vec3, cosine: f64) -> Option<Vec3> {
    (0..2).try_fold(*start, |axis, _| {
        let alike = near.iter().map(|&i| merged.normals[i]).filter(|n| n.dot(&axis) >= cosine);
        alike.sum::<Vec3>().try_normalize(0.0)
    })
}
