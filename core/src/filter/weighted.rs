//! The default filter: at one seed per reduction radius, a robust quadric through all measurements of the same
//! side of the surface.

use super::FilterParams;
use super::merged::Merged;
use super::quadric::{Fit, Measured, fit};
use crate::geometry::{Cloud, Vec3};
use crate::voxel::{CellIndex, keep_apart, sides};
use crate::{Progress, Result};
use rayon::prelude::*;

/// Points with less than this share of the median number of agreeing measurements float in space.
const LEAST_SHARE: f64 = 0.08;
/// Of the measurements near a point that has a surface, at least this share agree with it.
const LEAST_AGREEMENT: f64 = 0.35;
/// Radius within which standard deviations are pooled, in reduction radii: some thirty points.
const POOL: f64 = 3.0;
/// Seeds between two reports of progress.
const BATCH: usize = 4096;

pub(super) fn filter(
    merged: &Merged,
    noise_radius: f64,
    reduction_radius: f64,
    params: &FilterParams,
    progress: &Progress,
) -> Result<Cloud> {
    let cells = CellIndex::new(&merged.points, noise_radius);
    let seeds = seeds(merged, reduction_radius, params);
    let mut fits: Vec<Fit> = Vec::new();
    for (batch, chunk) in seeds.chunks(BATCH).enumerate() {
        progress.report("filter", (batch * BATCH) as f64 / seeds.len() as f64)?;
        let fitted: Vec<Option<Fit>> = chunk
            .par_iter()
            .map(|&seed| fit_seed(merged, &cells, seed, noise_radius, params))
            .collect();
        fits.extend(fitted.into_iter().flatten());
    }
    Ok(thin(fits, reduction_radius))
}

/// In each cell of the reduction radius, the most central measurement of each side of the surface.
fn seeds(merged: &Merged, reduction_radius: f64, params: &FilterParams) -> Vec<usize> {
    let cells = CellIndex::new(&merged.points, reduction_radius);
    let cosine = params.max_normal_angle.cos();
    let in_cell = |cell| {
        let central = |same: Vec<u32>| {
            let mean =
                same.iter().map(|&i| merged.points[i as usize]).sum::<Vec3>() / same.len() as f64;
            let distance = |i: &u32| (merged.points[*i as usize] - mean).norm_squared();
            same.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).map(|i| i as usize)
        };
        let found = sides(cells.points_in(cell), &merged.normals, cosine);
        found.into_iter().filter_map(central).collect()
    };
    let chosen: Vec<Vec<usize>> = cells.cells().par_iter().map(|&cell| in_cell(cell)).collect();
    chosen.into_iter().flatten().collect()
}

fn fit_seed(
    merged: &Merged,
    cells: &CellIndex,
    seed: usize,
    radius: f64,
    params: &FilterParams,
) -> Option<Fit> {
    let point = merged.points[seed];
    let cosine = params.max_normal_angle.cos();
    let mut near: Vec<usize> = Vec::new();
    cells.for_each_within(&merged.points, &point, radius, |i, _| near.push(i));
    let normal = mean_normal(merged, &near, &merged.normals[seed], cosine)?;
    let floor = f64::from(merged.noise[seed]) * 0.5;
    let measured: Vec<Measured> = near
        .iter()
        .filter(|&&i| merged.normals[i].dot(&normal) >= cosine)
        .map(|&i| {
            // Depth noise grows with the incidence; its square is the weight's inverse.
            let incidence = merged.rays[i].dot(&normal).abs().max(0.1);
            let noise = f64::from(merged.noise[i]);
            Measured {
                point: merged.points[i],
                scan: merged.scan[i],
                weight: (incidence / noise).powi(2),
            }
        })
        .collect();
    if measured.len() < params.min_measurements {
        return None;
    }
    let fit = fit(&measured, &point, &normal, radius, floor)?;
    let moved = (fit.point - point).norm();
    let good = fit.effective >= params.min_measurements as f64 / 2.0
        && fit.effective >= LEAST_AGREEMENT * measured.len() as f64
        && moved < 0.7 * radius
        && fit.normal.dot(&normal) > cosine;
    good.then_some(fit)
}

/// Mean of the normals on the side of `start`, twice, so that the start matters little.
fn mean_normal(merged: &Merged, near: &[usize], start: &Vec3, cosine: f64) -> Option<Vec3> {
    (0..2).try_fold(*start, |axis, _| {
        let alike = near.iter().map(|&i| merged.normals[i]).filter(|n| n.dot(&axis) >= cosine);
        alike.sum::<Vec3>().try_normalize(0.0)
    })
}

/// Keeps the best supported points, about a reduction radius from each other on each side.
fn thin(fits: Vec<Fit>, reduction_radius: f64) -> Cloud {
    let usual = crate::geometry::median(fits.iter().map(|f| f.effective).collect()).unwrap_or(0.0);
    let fits: Vec<Fit> = fits.into_iter().filter(|f| f.effective >= LEAST_SHARE * usual).collect();
    let mut order: Vec<usize> = (0..fits.len()).collect();
    order.sort_by(|&a, &b| fits[b].effective.total_cmp(&fits[a].effective).then(a.cmp(&b)));
    let points: Vec<Vec3> = fits.iter().map(|f| f.point).collect();
    let normals: Vec<Vec3> = fits.iter().map(|f| f.normal).collect();
    let mut cloud = Cloud::default();
    for i in keep_apart(&points, &normals, &order, reduction_radius) {
        let fit = &fits[i];
        cloud.push(fit.point, fit.normal, fit.sigma, fit.support);
    }
    cloud.sigma = pooled_sigma(&cloud, POOL * reduction_radius);
    cloud
}

/// The root mean square of the neighbours' standard deviations. One taken from a handful of scans is itself uncertain
/// by a third; weights made of it would favour the points that are certain by luck alone.
fn pooled_sigma(cloud: &Cloud, radius: f64) -> Vec<f64> {
    let cells = CellIndex::new(&cloud.points, radius);
    let pooled = |i: usize| {
        let (mut sum, mut count) = (0.0, 0.0);
        cells.for_each_within(&cloud.points, &cloud.points[i], radius, |j, _| {
            if cloud.normals[j].dot(&cloud.normals[i]) > 0.0 {
                sum += cloud.sigma[j] * cloud.sigma[j];
                count += 1.0;
            }
        });
        f64::sqrt(sum / count)
    };
    (0..cloud.len()).into_par_iter().map(pooled).collect()
}
