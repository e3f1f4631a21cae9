//! The measurements that the filtered cloud does not explain.

mod local_offset;
mod measurement;
mod surface_distance;
mod threshold;

use super::noise_estimate::NoiseEstimate;
use super::pooled::PooledMeasurements;
use crate::geometry::{Cloud, Pose};
use crate::scan::PreparedScan;
use local_offset::LocalOffsets;
use measurement::Measurement;
use rayon::prelude::*;
use surface_distance::{Deviation, SurfaceDistance};
use threshold::{MAX_ORIENTED_SIGMAS, ScoredMeasurement, unoriented_threshold};

/// The points of each raw scan that belong to no point of `cloud`, ascending.
///
/// `noise_radius` is that of the filter, `spacing` the distance between the points of `cloud`, both
/// in metres.
pub(super) fn find_outliers(
    scans: &[(&PreparedScan, Pose)],
    pooled: &PooledMeasurements,
    cloud: &Cloud,
    noise_radius: f64,
    spacing: f64,
    noise: &NoiseEstimate,
) -> Vec<Vec<u32>> {
    let surface = SurfaceDistance::new(cloud, pooled, noise_radius, spacing, noise);
    let scored: Vec<Vec<ScoredMeasurement>> = scans
        .iter()
        .map(|(scan, pose)| {
            score(&Measurement::from_scan(scan, pose), &surface, noise_radius, noise)
        })
        .collect();
    let threshold = unoriented_threshold(&scored);
    scored.iter().map(|scan| select_outliers(scan, threshold)).collect()
}

/// How far each measurement of one scan is off the surface.
fn score(
    measurements: &[Measurement],
    surface: &SurfaceDistance,
    noise_radius: f64,
    noise: &NoiseEstimate,
) -> Vec<ScoredMeasurement> {
    let deviations: Vec<Option<Deviation>> =
        measurements.par_iter().map(|m| surface.deviation(m)).collect();
    let offsets = LocalOffsets::new(&deviations, noise_radius, &noise.components);
    measurements
        .par_iter()
        .zip(&deviations)
        .map(|(m, deviation)| ScoredMeasurement {
            source: m.source,
            is_oriented: m.is_oriented,
            sigmas: deviation.as_ref().map_or(f64::INFINITY, |d| offsets.score(d)),
        })
        .collect()
}

/// The raw points of one scan that lie beyond the threshold of their kind, ascending.
fn select_outliers(scored: &[ScoredMeasurement], unoriented_threshold: f64) -> Vec<u32> {
    let mut outliers = Vec::new();
    for m in scored {
        let threshold = if m.is_oriented { MAX_ORIENTED_SIGMAS } else { unoriented_threshold };
        if m.sigmas > threshold {
            outliers.push(m.source);
        }
    }
    outliers.sort_unstable();
    outliers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measurements_without_a_normal_have_a_threshold_of_their_own() {
        let scored = [(7, true, 4.0), (3, true, 5.0), (5, false, 4.0), (1, false, 2.0)]
            .map(|(source, is_oriented, sigmas)| ScoredMeasurement { source, is_oriented, sigmas });
        assert_eq!(select_outliers(&scored, 3.0), [3, 5]);
    }
}
