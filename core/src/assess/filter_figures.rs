//! Figures of a filtered cloud, on simulated scans.
//!
//! *Outliers* are the measurements that the simulator labels as outlier or flying and that lie
//! farther than 4 standard deviations of the sensor from the true surface. Labelled measurements
//! that lie nearer count neither as outliers nor as good. *Removed* are the measurements that the
//! filter reports as explained by no point of its cloud.
//!
//! The root mean square error of the cloud is compared with its statistical limit, see
//! [`LimitEstimator`].

use super::distances::MM_PER_M;
use super::estimation_limit::{ErrorLimit, LimitEstimator};
use super::reference_surface::ReferenceSurface;
use super::statistics::{mean, rms, share};
use super::true_measurement::{MeasurementClass, TrueMeasurement, true_measurements};
use crate::filter::Filtered;
use crate::mesh::Mesh;
use crate::simulate::SimulatedScans;
use crate::{Progress, Result};
use serde::Serialize;

/// Figures of a filtered cloud. Lengths in mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FilterFigures {
    /// Measurements in all scans.
    pub measurements: usize,
    /// True outliers among them.
    pub outliers: usize,
    /// Measurements removed, without labelled ones near the surface.
    pub removed: usize,
    /// Share of the removed measurements that are outliers.
    pub precision: f64,
    /// Share of the outliers that are removed.
    pub recall: f64,
    /// Points of the cloud.
    pub kept: usize,
    /// Root mean square distance of the cloud to the truth.
    pub rms: f64,
    /// Root mean square statistical limit of the points.
    pub limit: f64,
    /// The same for the oracle, which knows how the arm wandered.
    pub limit_oracle: f64,
    /// Root mean square distance of those points whose limit was computed.
    pub rms_limited: f64,
    /// Share of the points whose distance is at most one stated standard deviation.
    pub within_1_sigma: f64,
    /// Share of the points whose distance is at most two stated standard deviations.
    pub within_2_sigma: f64,
    /// Root mean square stated standard deviation.
    pub sigma: f64,
    /// Mean signed distance, positive outside.
    pub bias: f64,
}

/// Measures the cloud that a filter made of `scans` at their true poses against `truth` (metres,
/// object frame).
///
/// # Errors
/// As [`ReferenceSurface::new`]; [`crate::Error::Input`] if the filter had another number of scans;
/// [`crate::Error::Cancelled`].
pub fn filter_figures(
    truth: &Mesh,
    scans: &SimulatedScans,
    filtered: &Filtered,
    progress: &Progress,
) -> Result<FilterFigures> {
    if filtered.outliers.len() != scans.views.len() {
        return Err(crate::Error::input(format!(
            "the filter had {} scans, the simulation {}",
            filtered.outliers.len(),
            scans.views.len()
        )));
    }
    progress.report("figures", 0.0)?;
    let reference = ReferenceSurface::new(truth)?;
    let views: Vec<Vec<TrueMeasurement>> =
        (0..scans.views.len()).map(|scan| true_measurements(scans, scan, &reference)).collect();
    let counts = OutlierCounts::new(&views, filtered);
    progress.report("figures", 0.5)?;
    let cloud = &filtered.cloud;
    let nearest = reference.nearest_all(&cloud.points);
    let errors: Vec<f64> = nearest
        .iter()
        .zip(&cloud.points)
        .map(|(n, p)| n.distance.copysign((p - n.point).dot(&n.normal)))
        .collect();
    let ratios: Vec<f64> = errors.iter().zip(&cloud.sigma).map(|(e, s)| e.abs() / s).collect();
    let limits = LimitEstimator::new(views, filtered.noise_radius).estimate(filtered);
    let limited: Vec<f64> = limits.iter().map(|l| errors[l.point]).collect();
    progress.report("figures", 1.0)?;
    Ok(FilterFigures {
        measurements: counts.measurements,
        outliers: counts.outliers,
        removed: counts.removed,
        precision: counts.removed_outliers as f64 / counts.removed as f64,
        recall: counts.removed_outliers as f64 / counts.outliers as f64,
        kept: cloud.len(),
        rms: MM_PER_M * rms(&errors),
        limit: rms_limit_mm(&limits, |l| l.usual),
        limit_oracle: rms_limit_mm(&limits, |l| l.oracle),
        rms_limited: MM_PER_M * rms(&limited),
        within_1_sigma: share(&ratios, |r| r <= 1.0),
        within_2_sigma: share(&ratios, |r| r <= 2.0),
        sigma: MM_PER_M * rms(&cloud.sigma),
        bias: MM_PER_M * mean(&errors),
    })
}

/// Root mean square of one of the limits, mm.
fn rms_limit_mm(limits: &[ErrorLimit], limit: fn(&ErrorLimit) -> f64) -> f64 {
    MM_PER_M * rms(&limits.iter().map(limit).collect::<Vec<f64>>())
}

/// Counts over the measurements of all scans.
struct OutlierCounts {
    measurements: usize,
    outliers: usize,
    removed: usize,
    /// Outliers that were removed.
    removed_outliers: usize,
}

impl OutlierCounts {
    fn new(views: &[Vec<TrueMeasurement>], filtered: &Filtered) -> OutlierCounts {
        let mut counts =
            OutlierCounts { measurements: 0, outliers: 0, removed: 0, removed_outliers: 0 };
        for (view, removed_indices) in views.iter().zip(&filtered.outliers) {
            for truth in view {
                let outlier = truth.class == MeasurementClass::Outlier;
                let removed = truth.class != MeasurementClass::Neither
                    && removed_indices.binary_search(&(truth.index as u32)).is_ok();
                counts.measurements += 1;
                counts.outliers += usize::from(outlier);
                counts.removed += usize::from(removed);
                counts.removed_outliers += usize::from(outlier && removed);
            }
        }
        counts
    }
}

#[cfg(test)]
#[path = "filter_figures_tests.rs"]
mod tests;
