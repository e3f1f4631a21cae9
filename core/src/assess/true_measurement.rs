//! The truth about each measurement of a simulated scan.

use super::reference_surface::ReferenceSurface;
use crate::geometry::{Vec3, transform};
use crate::simulate::{FLYING_LABEL, GOOD_LABEL, OUTLIER_LABEL, SimulatedScans, TrueNoise};
use rayon::prelude::*;

/// A labelled measurement is an outlier if it lies farther from the surface than this many standard
/// deviations of the sensor.
const MIN_OUTLIER_SIGMAS: f64 = 4.0;
/// Lower limit of the cosine of the incidence angle, which keeps the noise at grazing rays finite.
const MIN_INCIDENCE_COS: f64 = 1e-3;

/// The truth about one measurement.
pub(super) struct TrueMeasurement {
    /// Index in the raw scan.
    pub index: usize,
    /// The noise-free hit, object frame, metres.
    pub hit: Vec3,
    /// Outward normal of the surface at the hit.
    pub normal: Vec3,
    /// Standard deviation of the noise along the normal, metres.
    pub sigma: f64,
    pub class: MeasurementClass,
    pub noise: TrueNoise,
    pub scan: usize,
}

/// Whether a filter should keep a measurement.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum MeasurementClass {
    Good,
    Outlier,
    /// A labelled measurement near the surface.
    Neither,
}

/// The truth about all returns of one scan.
pub(super) fn true_measurements(
    scans: &SimulatedScans,
    scan: usize,
    reference: &ReferenceSurface,
) -> Vec<TrueMeasurement> {
    let view = &scans.views[scan];
    let noise = TrueNoise::new(scans.family, view.scan.width, view.scan.height());
    let returns: Vec<usize> = view.scan.returns().collect();
    let measurements = returns.into_par_iter().filter_map(|index| {
        let measured = view.scan.point(index)?;
        let in_sensor = Vec3::from(view.hits[index].map(f64::from));
        let ray = (measured - view.scan.origin(index)).try_normalize(0.0)?;
        let hit = transform(&view.true_pose, &in_sensor);
        let normal = reference.nearest(&hit).normal;
        let cosine = (view.true_pose.rotation * ray).dot(&normal).abs().max(MIN_INCIDENCE_COS);
        let sigma = noise.sigma(&in_sensor, &ray, cosine) * cosine;
        let class = match view.labels[index] {
            OUTLIER_LABEL | FLYING_LABEL => {
                let distance = reference.nearest(&transform(&view.true_pose, &measured)).distance;
                let limit =
                    MIN_OUTLIER_SIGMAS * sigma.hypot(noise.walk_covariance(index, index).sqrt());
                if distance > limit { MeasurementClass::Outlier } else { MeasurementClass::Neither }
            }
            GOOD_LABEL => MeasurementClass::Good,
            _ => MeasurementClass::Neither,
        };
        Some(TrueMeasurement { index, hit, normal, sigma, class, noise, scan })
    });
    measurements.collect()
}
