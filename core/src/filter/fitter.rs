//! The fit of a surface to the measurements near a seed.

use super::FilterParams;
use super::merged::Merged;
use super::quadric::{Fit, Measured, fit};
use crate::geometry::{Components, Vec3, median};

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
/// Standard deviations along the normal within which a surface is looked for, but not farther than along it.
const DEEP: f64 = 14.0;
/// If the surface lies farther from the seed than this share of the radius, or its normal is turned by more than this
/// cosine, it is fitted anew about the foot point: what lies within reach of a noisy seed leans towards the seed.
const OFF: f64 = 0.1;
const TURNED: f64 = 0.99;
/// The smaller radii, in the noise radius.
const SMALLER: [f64; 2] = [0.6, 0.36];

/// All that fits share.
pub(super) struct Fitter<'a> {
    merged: &'a Merged,
    radius: f64,
    /// How far from the seed along the normal a measurement may be that belongs, metres.
    depth: f64,
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
        let usual = median(merged.sigma.iter().map(|s| f64::from(*s)).collect()).unwrap_or(0.0);
        let depth = (DEEP * usual * noise.total().sqrt()).min(radius);
        Fitter { merged, radius, depth, params, noise }
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

    /// The measurements within a cylinder about the seed, whatever its axis: so deep that noise does not decide which belong.
    fn near(&self, seed: usize) -> Vec<usize> {
        let (points, mut near) = (&self.merged.points, Vec::new());
        let search = self.radius.hypot(self.depth);
        self.merged.cells.for_each_within(points, &points[seed], search, |i, _| near.push(i));
        near
    }

    fn fit_within(&self, seed: usize, near: &[usize], share: f64) -> Option<Fit> {
        let (merged, radius) = (self.merged, self.radius * share);
        let point = merged.points[seed];
        let cosine = self.params.max_normal_angle.cos();
        let normal = mean_normal(merged, near, &point, radius, &merged.normals[seed], cosine)?;
        let enough = if share < 1.0 { DENSE } else { 1 } * self.params.min_measurements;
        let fit_about = |center: &Vec3, normal: &Vec3| {
            let measured = self.in_cylinder(near, center, normal, radius);
            if measured.len() < enough {
                return None;
            }
            Some((fit(&measured, center, normal, radius, &self.noise)?, measured.len()))
        };
        let (mut fit, mut count) = fit_about(&point, &normal)?;
        if (fit.point - point).norm() > OFF * radius || fit.normal.dot(&normal) < TURNED {
            (fit, count) = fit_about(&fit.point, &fit.normal)?;
        }
        let moved = (fit.point - point).norm();
        let good = fit.effective >= self.params.min_measurements as f64 / 2.0
            && fit.effective >= LEAST_AGREEMENT * count as f64
            && moved < 0.7 * self.radius
            && fit.normal.dot(&normal) > cosine;
        // As many as there would be within the whole radius, so that support compares.
        fit.effective /= share * share;
        good.then_some(fit)
    }

    /// Those of `near` on the side of `normal`, along the surface within `radius` of `center`.
    fn in_cylinder(
        &self,
        near: &[usize],
        center: &Vec3,
        normal: &Vec3,
        radius: f64,
    ) -> Vec<Measured> {
        let (merged, cosine) = (self.merged, self.params.max_normal_angle.cos());
        let inside = |&i: &usize| {
            let offset = merged.points[i] - center;
            let height = offset.dot(normal);
            merged.normals[i].dot(normal) >= cosine
                && offset.norm_squared() - height * height <= radius * radius
                && height.abs() <= self.depth
        };
        let measured = |i: usize| Measured {
            point: merged.points[i],
            scan: merged.scan[i],
            sigma: f64::from(merged.sigma[i]),
        };
        near.iter().copied().filter(inside).map(measured).collect()
    }
}

/// Mean of the normals within `radius` of `center` on the side of `start`, twice, so that the start matters little.
fn mean_normal(
    merged: &Merged,
    near: &[usize],
    center: &Vec3,
    radius: f64,
    start: &Vec3,
    cosine: f64,
) -> Option<Vec3> {
    let inside = |i: &&usize| (merged.points[**i] - center).norm_squared() <= radius * radius;
    let normals: Vec<Vec3> = near.iter().filter(inside).map(|&i| merged.normals[i]).collect();
    (0..2).try_fold(*start, |axis, _| {
        normals.iter().filter(|n| n.dot(&axis) >= cosine).sum::<Vec3>().try_normalize(0.0)
    })
}
