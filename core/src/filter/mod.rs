//! From registered scans to one oriented cloud with uncertainty (Wiedemann 2014, §2.3.2).
//!
//! Both filters combine redundant measurements and thin the points to the reduction radius `r_red`,
//! with measurements of the same surface within the noise radius `r_noise`. The default one fits a
//! local quadric robustly to the measurements of all scans (`weighted_method`); that of the thesis
//! averages in a slim neighbourhood along the normal (`thesis_method`).
//!
//! ```
//! use puffer_core::Progress;
//! use puffer_core::filter::{FilterParams, filter};
//! use puffer_core::geometry::{Pose, Scan};
//! use puffer_core::scan::PreparedScan;
//!
//! // A wavy surface of 60 x 60 mm, 0.3 m before the sensor.
//! let points = (0..3600)
//!     .map(|i| {
//!         let (x, y) = ((i % 60) as f32 * 1e-3 - 0.03, (i / 60) as f32 * 1e-3 - 0.03);
//!         [x, y, 0.3 + 5e-3 * (150.0 * x).sin() * (120.0 * y).cos()]
//!     })
//!     .collect();
//! let scan = Scan { points, width: 60, origins: Vec::new() };
//! let prepared = PreparedScan::new(&scan)?;
//! let scans = [(&prepared, Pose::identity()), (&prepared, Pose::identity())];
//! let filtered = filter(&scans, None, &FilterParams::default(), &Progress::silent())?;
//! assert_eq!(filtered.measurements, 2 * prepared.points.len());
//! assert!(!filtered.cloud.is_empty() && filtered.cloud.len() < filtered.measurements);
//! assert!(filtered.cloud.normals.iter().all(|normal| normal.z < 0.0), "towards the sensor");
//! # Ok::<(), puffer_core::Error>(())
//! ```

mod fit;
mod noise_estimate;
mod outliers;
mod params;
mod pooled;
mod radii;
mod thesis_method;
mod weighted_method;

pub use params::{FilterMethod, FilterParams};

use crate::geometry::{Cloud, NoiseComponents, Pose};
use crate::scan::PreparedScan;
use crate::{Error, Progress, Result};
use noise_estimate::NoiseEstimate;
use outliers::find_outliers;
use pooled::PooledMeasurements;
use radii::Radii;

/// A filtered cloud and the radii that made it.
#[derive(Clone, Debug)]
pub struct Filtered {
    /// One point per reduction radius, object frame, in single precision.
    pub cloud: Cloud,
    /// Radius within which measurements were combined, metres.
    pub noise_radius: f64,
    /// Distance between the points, metres.
    pub reduction_radius: f64,
    /// Number of measurements that went in.
    pub measurements: usize,
    /// For each scan, ascending, the points of the raw scan ([`PreparedScan::raw_indices`]) that no
    /// point of the cloud explains: those that lie farther from it than the noise, and what it
    /// shares with its neighbours, let expect.
    pub outliers: Vec<Vec<u32>>,
    /// The components of the noise, in units of the variances that the scans state.
    pub noise: NoiseComponents,
}

/// Combines registered scans, each with its pose `object_from_sensor`.
///
/// `residual` is the root mean square distance between overlapping scans, metres, if it is known.
///
/// # Errors
/// [`Error::Input`] if nothing is left or there are more than 65,535 scans; [`Error::Cancelled`].
pub fn filter(
    scans: &[(&PreparedScan, Pose)],
    residual: Option<f64>,
    params: &FilterParams,
    progress: &Progress,
) -> Result<Filtered> {
    progress.report("filter", 0.0)?;
    let Radii { noise: noise_radius, reduction: reduction_radius } =
        Radii::new(scans, residual, params);
    let mut pooled = PooledMeasurements::new(scans, noise_radius)?;
    let noise = NoiseEstimate::new(&mut pooled, noise_radius, reduction_radius, params);
    let cloud = match params.method {
        FilterMethod::Weighted => weighted_method::filter(
            &pooled,
            noise_radius,
            reduction_radius,
            params,
            &noise,
            progress,
        )?,
        FilterMethod::Thesis => {
            thesis_method::filter(&pooled, noise_radius, reduction_radius, params, progress)?
        }
    };
    if cloud.is_empty() {
        return Err(Error::input(format!(
            "the filter kept none of {} measurements: with noise radius {:.2} mm none has {} neighbours; \
             raise filter.noise_radius or lower filter.min_measurements",
            pooled.points.len(),
            noise_radius * 1e3,
            params.min_measurements
        )));
    }
    progress.report("filter", 1.0)?;
    let cloud = cloud.to_single_precision();
    let outliers = find_outliers(scans, &pooled, &cloud, noise_radius, reduction_radius, &noise);
    Ok(Filtered {
        cloud,
        noise_radius,
        reduction_radius,
        measurements: pooled.points.len(),
        outliers,
        noise: noise.components,
    })
}

#[cfg(test)]
mod tests;
