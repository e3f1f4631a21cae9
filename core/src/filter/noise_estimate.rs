//! The noise of all scans, estimated from how their measurements scatter about common surfaces.

use super::fit::{Fit, Fitter, find_seeds};
use super::params::FilterParams;
use super::pooled::PooledMeasurements;
use crate::geometry::{NoiseComponents, NoiseModel, RangeResidual, ResidualMoments, median};
use rayon::prelude::*;
use std::f64::consts::SQRT_2;

/// Seeds, at most, at whose fits the noise is estimated: enough for its model, and quick.
const MAX_SEEDS: usize = 2000;
/// Lateral distance from a seed, in noise radii, within which measurements are compared: so near,
/// the curvature of the surface does not matter.
const LATERAL_REACH_RATIO: f64 = 0.35;
/// Residuals beyond this many times their median size are outliers. For normally distributed ones
/// that is about five standard deviations.
const OUTLIER_MEDIAN_RATIO: f64 = 7.0;

/// The noise of the measurements, relative to what their scans state.
pub(super) struct NoiseEstimate {
    /// Factor, by range and incidence, on the standard deviations that the scans state.
    pub correction: NoiseModel,
    /// The components of the corrected noise, in units of the corrected variances.
    pub components: NoiseComponents,
}

impl NoiseEstimate {
    /// Estimates the noise, and corrects the standard deviations of `pooled`: a scan by itself sees
    /// little of the errors that its neighbouring measurements share.
    pub(super) fn new(
        pooled: &mut PooledMeasurements,
        noise_radius: f64,
        reduction_radius: f64,
        params: &FilterParams,
    ) -> NoiseEstimate {
        let all = find_seeds(pooled, reduction_radius, params);
        let stride = all.len().div_ceil(MAX_SEEDS).max(1);
        let seeds: Vec<usize> = all.into_iter().step_by(stride).collect();
        let fits = fit_seeds(pooled, &seeds, noise_radius, params);
        let correction = NoiseModel::estimate(&paired_residuals(pooled, &fits, noise_radius))
            .unwrap_or_else(|| NoiseModel::constant(1.0));
        pooled.scale_sigma(&correction);
        let mut moments = ResidualMoments::default();
        for fit in fit_seeds(pooled, &seeds, noise_radius, params) {
            moments.add(&fit.moments);
        }
        NoiseEstimate { correction, components: moments.components() }
    }
}

/// The surfaces at `seeds`, fitted as if all noise were white.
fn fit_seeds(
    pooled: &PooledMeasurements,
    seeds: &[usize],
    noise_radius: f64,
    params: &FilterParams,
) -> Vec<Fit> {
    let fitter = Fitter::new(pooled, noise_radius, params, NoiseComponents::WHITE);
    let fits: Vec<Option<Fit>> =
        seeds.par_iter().map(|&seed| fitter.fit_whole_radius(seed)).collect();
    fits.into_iter().flatten().collect()
}

/// Differences between two scans' measurements of one place, in stated standard deviations, divided
/// by the square root of two so that they scatter like one measurement. They contain all the noise
/// that the two scans do not share, whichever surface was fitted.
fn paired_residuals(
    pooled: &PooledMeasurements,
    fits: &[Fit],
    noise_radius: f64,
) -> Vec<RangeResidual> {
    let residuals: Vec<Vec<RangeResidual>> = fits
        .par_iter()
        .map(|fit| pair_scans(measurements_near(pooled, fit, noise_radius)))
        .collect();
    residuals.concat()
}

/// A measurement near the foot point of a fit.
struct NearMeasurement {
    scan: u16,
    /// Squared distance from the foot point along the surface, square metres.
    lateral_squared: f64,
    /// Distance from the sensor, metres.
    range: f64,
    /// Cosine of the incidence on the fitted surface, not negative.
    cosine: f64,
    /// Height above the tangent plane in stated standard deviations.
    height: f64,
}

/// The measurements near the foot point of `fit`, of the same side of the surface.
fn measurements_near(
    pooled: &PooledMeasurements,
    fit: &Fit,
    noise_radius: f64,
) -> Vec<NearMeasurement> {
    let reach_squared = (LATERAL_REACH_RATIO * noise_radius).powi(2);
    let mut near = Vec::new();
    pooled.cells.for_each_within(
        &pooled.points,
        &fit.point,
        noise_radius,
        |i, distance_squared| {
            let height = (pooled.points[i] - fit.point).dot(&fit.normal);
            let lateral_squared = distance_squared - height * height;
            if pooled.normals[i].dot(&fit.normal) > 0.0 && lateral_squared < reach_squared {
                near.push(NearMeasurement {
                    scan: pooled.scan[i],
                    lateral_squared,
                    range: f64::from(pooled.range[i]),
                    cosine: pooled.rays[i].dot(&fit.normal).abs(),
                    height: height / f64::from(pooled.sigma[i]),
                });
            }
        },
    );
    near
}

/// Takes from each scan the measurement nearest to the foot point, and pairs scans that see the
/// surface at similar incidence.
fn pair_scans(mut near: Vec<NearMeasurement>) -> Vec<RangeResidual> {
    let Some(median_size) = median(near.iter().map(|m| m.height.abs()).collect()) else {
        return Vec::new();
    };
    near.retain(|m| m.height.abs() <= OUTLIER_MEDIAN_RATIO * median_size);
    near.sort_by(|a, b| a.scan.cmp(&b.scan).then(a.lateral_squared.total_cmp(&b.lateral_squared)));
    near.dedup_by_key(|m| m.scan);
    near.sort_by(|a, b| a.cosine.total_cmp(&b.cosine));
    near.chunks_exact(2)
        .map(|pair| RangeResidual {
            range: (pair[0].range + pair[1].range) / 2.0,
            cosine: (pair[0].cosine + pair[1].cosine) / 2.0,
            distance: (pair[0].height - pair[1].height) / SQRT_2,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measurement(scan: u16, lateral_squared: f64, cosine: f64, height: f64) -> NearMeasurement {
        NearMeasurement { scan, lateral_squared, range: 0.5, cosine, height }
    }

    #[test]
    fn scans_of_similar_incidence_are_paired_by_their_nearest_measurements() {
        let pairs = pair_scans(vec![
            measurement(0, 4.0, 0.9, 5.0),
            measurement(0, 1.0, 0.9, 1.0),
            measurement(1, 1.0, 0.3, -2.0),
            measurement(2, 1.0, 0.8, 3.0),
            measurement(3, 1.0, 0.4, 2.0),
        ]);
        let found: Vec<(f64, f64)> = pairs.iter().map(|r| (r.cosine, r.distance)).collect();
        // By cosine: scans 1 and 3, then 2 and 0, of which the nearer measurement counts.
        assert!((found[0].0 - 0.35).abs() < 1e-12 && (found[1].0 - 0.85).abs() < 1e-12);
        assert!((found[0].1 + 4.0 / SQRT_2).abs() < 1e-12, "{found:?}");
        assert!((found[1].1 - 2.0 / SQRT_2).abs() < 1e-12, "{found:?}");
        assert_eq!(found.len(), 2);
    }

    #[test]
    fn an_outlier_is_not_paired() {
        let mut near: Vec<NearMeasurement> =
            (0..5).map(|scan| measurement(scan, 1.0, 0.9, 1.0)).collect();
        near.push(measurement(5, 1.0, 0.9, 100.0));
        assert!(pair_scans(near).iter().all(|r| r.distance == 0.0));
        assert!(pair_scans(Vec::new()).is_empty());
    }
}
