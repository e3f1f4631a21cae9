//! From registered scans to one oriented cloud with uncertainty (Wiedemann 2014, §2.3.2).
//!
//! Both filters combine redundant measurements and thin the points to the reduction radius `r_red`, looking
//! for measurements of the same surface within the noise radius `r_noise`. The default one fits a local quadric
//! robustly to all scans' measurements (`weighted`); the thesis's averages in a slim neighbourhood along
//! the normal (`thesis`).

mod fitter;
mod learnt;
mod merged;
mod mixed;
mod neighbours;
mod quadric;
mod refused;
mod seeds;
mod standing;
mod thesis;
mod weighted;

use crate::geometry::{Cloud, Components, Pose};
use crate::register::PreparedScan;
use crate::{Error, Progress, Result};
use learnt::Learnt;
use merged::Merged;

crate::choice! {
    /// How redundant measurements are combined.
    pub enum Method {
        /// A robust quadric through all scans' measurements.
        Weighted = "weighted",
        /// The thesis's averaging along the normals.
        Thesis = "thesis",
    }
}

crate::params! {
    /// Parameters of the filter.
    pub struct FilterParams("filter") {
        /// How redundant measurements are combined.
        method: Method = Method::Weighted;
        /// Measurements within this radius are combined; 0 takes it from spacing and noise of the data.
        noise_radius: f64 = 0.0, in [0.0, 0.1], unit "m";
        /// Distance that the points kept have from each other; 0 takes it from spacing and noise of the data.
        reduction_radius: f64 = 0.0, in [0.0, 0.1], unit "m";
        /// Measurements whose normals differ by more are not combined.
        max_normal_angle: f64 = 0.785, in [0.0, 3.15], unit "rad";
        /// Fewer measurements than this do not support a point.
        min_measurements: usize = 6, in [1, 1000000];
    }
}

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
    /// For each scan, ascending, the points of the raw scan ([`PreparedScan::source`]) that no point of the cloud
    /// explains: those farther from it than the noise and what it shares with its neighbours let expect.
    pub refused: Vec<Vec<u32>>,
    /// What the noise is made of, in units of the variances that the scans state.
    pub noise: Components,
}

/// Combines registered scans, each with its pose `object_from_sensor`.
///
/// `residual` is the root mean square distance between overlapping scans (metres; NaN if unknown).
///
/// # Errors
/// [`Error::Input`] if nothing is left; [`Error::Cancelled`].
pub fn filter(
    scans: &[(&PreparedScan, Pose)],
    residual: f64,
    params: &FilterParams,
    progress: &Progress,
) -> Result<Filtered> {
    progress.report("filter", 0.0)?;
    let (noise_radius, reduction_radius) = radii(scans, residual, params);
    let mut merged = Merged::new(scans, noise_radius);
    let noise = Learnt::new(&mut merged, noise_radius, reduction_radius, params);
    let (of_noise, of_reduction) = (noise_radius, reduction_radius);
    let cloud = match params.method {
        Method::Weighted => {
            weighted::filter(&merged, of_noise, of_reduction, params, &noise, progress)?
        }
        Method::Thesis => thesis::filter(&merged, of_noise, of_reduction, params, progress)?,
    };
    if cloud.is_empty() {
        return Err(Error::input(format!(
            "the filter kept none of {} measurements: with noise radius {:.2} mm none has {} neighbours; \
             raise filter.noise_radius or lower filter.min_measurements",
            merged.points.len(),
            noise_radius * 1e3,
            params.min_measurements
        )));
    }
    progress.report("filter", 1.0)?;
    let cloud = cloud.to_single_precision();
    let refused = refused::refused(scans, &merged, &cloud, noise_radius, reduction_radius, &noise);
    let measurements = merged.points.len();
    Ok(Filtered {
        cloud,
        noise_radius,
        reduction_radius,
        measurements,
        refused,
        noise: noise.components,
    })
}

/// Radii from the data: wide enough for a dozen measurements of one scan, and for the noise (with the error
/// of the poses) to be averaged over several times its own size, else the fitted plane tilts.
fn radii(scans: &[(&PreparedScan, Pose)], residual: f64, params: &FilterParams) -> (f64, f64) {
    let typical = |f: fn(&PreparedScan) -> f64| {
        crate::geometry::median(scans.iter().map(|(scan, _)| f(scan)).collect()).unwrap_or(1e-3)
    };
    let noise = typical(|s| s.noise).max(if residual.is_finite() { residual } else { 0.0 });
    let automatic = (2.5 * typical(|s| s.spacing)).max(fitter::LEAST_RADIUS * noise);
    let noise_radius = if params.noise_radius > 0.0 { params.noise_radius } else { automatic };
    let reduction =
        if params.reduction_radius > 0.0 { params.reduction_radius } else { noise_radius / 2.5 };
    (noise_radius, reduction)
}

#[cfg(test)]
mod tests;
