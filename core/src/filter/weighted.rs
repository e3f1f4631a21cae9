//! The default filter: at one seed per reduction radius, a robust quadric through all measurements of the same
//! side of the surface.

use super::FilterParams;
use super::fitter::Fitter;
use super::learnt::Learnt;
use super::merged::Merged;
use super::quadric::Fit;
use super::seeds::seeds;
use crate::geometry::{Cloud, Components, Vec3};
use crate::voxel::{CellIndex, keep_apart};
use crate::{Progress, Result};
use rayon::prelude::*;

/// Points with less than this share of the median number of agreeing measurements float in space.
const LEAST_SHARE: f64 = 0.02;
/// Radius within which standard deviations are pooled, in reduction radii: some thirty points.
const POOL: f64 = 3.0;
/// Scans' worth of belief in the noise that is common to all points.
const COMMON_BELIEF: f64 = 5.0;
/// Seeds between two reports of progress.
const BATCH: usize = 4096;

pub(super) fn filter(
    merged: &Merged,
    noise_radius: f64,
    reduction_radius: f64,
    params: &FilterParams,
    noise: &Learnt,
    progress: &Progress,
) -> Result<Cloud> {
    let seeds = seeds(merged, reduction_radius, params);
    let fitter = Fitter::new(merged, noise_radius, params, noise.components);
    let mut fits: Vec<Fit> = Vec::new();
    for (batch, chunk) in seeds.chunks(BATCH).enumerate() {
        progress.report("filter", (batch * BATCH) as f64 / seeds.len() as f64)?;
        let fitted: Vec<Option<Fit>> = chunk.par_iter().map(|&seed| fitter.fit(seed)).collect();
        fits.extend(fitted.into_iter().flatten());
    }
    Ok(thin(fits, reduction_radius, &noise.components))
}

/// Keeps the best supported points, about a reduction radius from each other on each side.
fn thin(fits: Vec<Fit>, reduction_radius: f64, noise: &Components) -> Cloud {
    let usual = crate::geometry::median(fits.iter().map(|f| f.effective).collect()).unwrap_or(0.0);
    let fits: Vec<Fit> = fits.into_iter().filter(|f| f.effective >= LEAST_SHARE * usual).collect();
    let mut order: Vec<usize> = (0..fits.len()).collect();
    order.sort_by(|&a, &b| fits[b].effective.total_cmp(&fits[a].effective).then(a.cmp(&b)));
    let points: Vec<Vec3> = fits.iter().map(|f| f.point).collect();
    let normals: Vec<Vec3> = fits.iter().map(|f| f.normal).collect();
    let kept = keep_apart(&points, &normals, &order, reduction_radius);
    let mut cloud = Cloud::default();
    for &i in &kept {
        let fit = &fits[i];
        cloud.push(fit.point, fit.normal, fit.sigma, fit.support);
    }
    let excess: Vec<(f64, f64)> = kept.iter().map(|&i| fits[i].moments.excess(noise)).collect();
    cloud.sigma = corrected_sigma(&cloud, &excess, POOL * reduction_radius);
    cloud
}

/// Standard deviations, times what the scans near a point differ more or less from each other than the noise lets
/// expect: where poses err or the surface is no quadric. One point's spread is uncertain by a third; weights made of
/// it would favour the points that are certain by luck alone. So neighbours are pooled, and the common noise is
/// believed as much as so many scans.
fn corrected_sigma(cloud: &Cloud, excess: &[(f64, f64)], radius: f64) -> Vec<f64> {
    let cells = CellIndex::new(&cloud.points, radius);
    let corrected = |i: usize| {
        let (mut ratio, mut scans, mut count) = (0.0, 0.0, 0.0);
        cells.for_each_within(&cloud.points, &cloud.points[i], radius, |j, _| {
            if cloud.normals[j].dot(&cloud.normals[i]) > 0.0 {
                ratio += excess[j].0 * excess[j].1;
                scans += excess[j].1;
                count += 1.0;
            }
        });
        // Neighbours see the same scans' errors: they are counted once.
        let pooled = (ratio / count + COMMON_BELIEF) / (scans / count + COMMON_BELIEF);
        cloud.sigma[i] * pooled.sqrt()
    };
    (0..cloud.len()).into_par_iter().map(corrected).collect()
}
