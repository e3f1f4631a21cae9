//! The default filter: at one seed per reduction radius, a robust quadric through all measurements
//! of the same side of the surface.

use super::fit::{Fit, Fitter, find_seeds};
use super::noise_estimate::NoiseEstimate;
use super::params::FilterParams;
use super::pooled::PooledMeasurements;
use crate::geometry::{Cloud, Excess, NoiseComponents, Vec3, median};
use crate::voxel::{CellIndex, thin_by_distance};
use crate::{Progress, Result};
use rayon::prelude::*;

/// Points with less than this share of the median number of agreeing measurements float in space.
const MIN_SUPPORT_RATIO: f64 = 0.02;
/// Radius within which standard deviations are pooled, in reduction radii: some thirty points.
const POOLING_RADIUS_RATIO: f64 = 3.0;
/// Weight of the noise that is common to all points, in scans, when standard deviations are pooled.
const PRIOR_SCANS: f64 = 5.0;
/// Seeds between two reports of progress.
const BATCH_SEEDS: usize = 4096;

/// Combines `pooled` into one point per `reduction_radius` (metres) from measurements within
/// `noise_radius` (metres).
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn filter(
    pooled: &PooledMeasurements,
    noise_radius: f64,
    reduction_radius: f64,
    params: &FilterParams,
    noise: &NoiseEstimate,
    progress: &Progress,
) -> Result<Cloud> {
    let seeds = find_seeds(pooled, reduction_radius, params);
    let fitter = Fitter::new(pooled, noise_radius, params, noise.components);
    let mut fits: Vec<Fit> = Vec::new();
    for (batch, chunk) in seeds.chunks(BATCH_SEEDS).enumerate() {
        progress.report("filter", (batch * BATCH_SEEDS) as f64 / seeds.len() as f64)?;
        let fitted: Vec<Option<Fit>> = chunk.par_iter().map(|&seed| fitter.fit(seed)).collect();
        fits.extend(fitted.into_iter().flatten());
    }
    Ok(thin(fits, reduction_radius, &noise.components))
}

/// Keeps the best supported points, about a reduction radius from each other on each side.
fn thin(fits: Vec<Fit>, reduction_radius: f64, noise: &NoiseComponents) -> Cloud {
    let median_support = median(fits.iter().map(|f| f.effective).collect()).unwrap_or(0.0);
    let fits: Vec<Fit> =
        fits.into_iter().filter(|f| f.effective >= MIN_SUPPORT_RATIO * median_support).collect();
    let mut order: Vec<usize> = (0..fits.len()).collect();
    order.sort_by(|&a, &b| fits[b].effective.total_cmp(&fits[a].effective).then(a.cmp(&b)));
    let points: Vec<Vec3> = fits.iter().map(|f| f.point).collect();
    let normals: Vec<Vec3> = fits.iter().map(|f| f.normal).collect();
    let kept = thin_by_distance(&points, &normals, &order, reduction_radius);
    let mut cloud = Cloud::default();
    for &i in &kept {
        let fit = &fits[i];
        cloud.push(fit.point, fit.normal, fit.sigma, fit.support);
    }
    let excess: Vec<Excess> = kept.iter().map(|&i| fits[i].moments.excess(noise)).collect();
    cloud.sigma = corrected_sigma(&cloud, &excess, POOLING_RADIUS_RATIO * reduction_radius);
    cloud
}

/// The standard deviations of the points of `cloud`, corrected by how much more or less the scans
/// near each point differ from each other than the noise lets expect: where poses err, or where the
/// surface is no quadric.
///
/// The spread at a single point is uncertain by a third, and weights made of it would favour points
/// that are certain by chance alone. Therefore the spreads of the neighbours within `radius`
/// (metres) are pooled, with the noise that is common to all points as a prior.
fn corrected_sigma(cloud: &Cloud, excess: &[Excess], radius: f64) -> Vec<f64> {
    let cells = CellIndex::new(&cloud.points, radius);
    (0..cloud.len())
        .into_par_iter()
        .map(|i| {
            let (mut ratio, mut scans, mut count) = (0.0, 0.0, 0.0);
            cells.for_each_within(&cloud.points, &cloud.points[i], radius, |j, _| {
                if cloud.normals[j].dot(&cloud.normals[i]) > 0.0 {
                    ratio += excess[j].variance_ratio * excess[j].scans;
                    scans += excess[j].scans;
                    count += 1.0;
                }
            });
            // Neighbours see the errors of the same scans, which therefore count once.
            let variance_factor = (ratio / count + PRIOR_SCANS) / (scans / count + PRIOR_SCANS);
            cloud.sigma[i] * variance_factor.sqrt()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point_pair(distance: f64) -> Cloud {
        let mut cloud = Cloud::default();
        cloud.push(Vec3::zeros(), Vec3::z(), 1e-4, 3);
        cloud.push(Vec3::x() * distance, Vec3::z(), 1e-4, 3);
        cloud
    }

    #[test]
    fn sigma_follows_the_excess_of_the_neighbours_beside_the_prior() {
        let excess = [
            Excess { variance_ratio: 4.0, scans: 5.0 },
            Excess { variance_ratio: 1.0, scans: 5.0 },
        ];
        let apart = corrected_sigma(&point_pair(1.0), &excess, 0.1);
        // (4 * 5 + 5) / (5 + 5) = 2.5 and (1 * 5 + 5) / (5 + 5) = 1.
        assert!((apart[0] - 1e-4 * 2.5_f64.sqrt()).abs() < 1e-16, "{apart:?}");
        assert!((apart[1] - 1e-4).abs() < 1e-16, "{apart:?}");
        // Together: ((20 + 5) / 2 + 5) / (10 / 2 + 5) = 1.75 for both.
        for sigma in corrected_sigma(&point_pair(0.05), &excess, 0.1) {
            assert!((sigma - 1e-4 * 1.75_f64.sqrt()).abs() < 1e-16, "{sigma}");
        }
    }
}
