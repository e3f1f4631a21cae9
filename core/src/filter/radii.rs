//! The radii of the filter, from the parameters or from the data.

use super::fit::MIN_RADIUS_SIGMAS;
use super::params::FilterParams;
use crate::geometry::{Pose, median};
use crate::scan::PreparedScan;

/// Noise radius in spacings of the points: wide enough for a dozen measurements of one scan.
const NOISE_RADIUS_SPACINGS: f64 = 2.5;
/// Noise radius in reduction radii, so that neighbouring points of the cloud share measurements.
const NOISE_PER_REDUCTION_RADIUS: f64 = 2.5;
/// Spacing and noise if there is no scan, metres.
const DEFAULT_LENGTH_M: f64 = 1e-3;

/// The radii that the filter works with, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Radii {
    /// Within it measurements are combined.
    pub noise: f64,
    /// Distance between the points of the cloud.
    pub reduction: f64,
}

impl Radii {
    /// The radii that `params` give, else those that follow from the data: wide enough for a dozen
    /// measurements of one scan, and so wide that the noise (with the error of the poses, of which
    /// `residual` tells, metres) is averaged over several times its own size, because the fitted
    /// plane would tilt otherwise.
    pub(super) fn new(
        scans: &[(&PreparedScan, Pose)],
        residual: Option<f64>,
        params: &FilterParams,
    ) -> Radii {
        let residual = residual.filter(|r| r.is_finite()).unwrap_or(0.0);
        let sigma = median_over(scans, |scan| scan.noise).max(residual);
        let spacing = median_over(scans, |scan| scan.spacing);
        let automatic = (NOISE_RADIUS_SPACINGS * spacing).max(MIN_RADIUS_SIGMAS * sigma);
        let noise = if params.noise_radius > 0.0 { params.noise_radius } else { automatic };
        let reduction = if params.reduction_radius > 0.0 {
            params.reduction_radius
        } else {
            noise / NOISE_PER_REDUCTION_RADIUS
        };
        Radii { noise, reduction }
    }
}

/// The median over the scans of a length, metres.
fn median_over(scans: &[(&PreparedScan, Pose)], length: fn(&PreparedScan) -> f64) -> f64 {
    median(scans.iter().map(|(scan, _)| length(scan)).collect()).unwrap_or(DEFAULT_LENGTH_M)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_larger_of_spacing_and_noise_decides_unless_a_radius_is_given() {
        let scan = PreparedScan { spacing: 1e-3, noise: 1e-4, ..PreparedScan::default() };
        let scans = [(&scan, Pose::identity())];
        let mut params = FilterParams::default();
        let by_spacing = Radii::new(&scans, None, &params);
        assert!((by_spacing.noise - 2.5e-3).abs() < 1e-12, "{by_spacing:?}");
        assert!((by_spacing.reduction - 1e-3).abs() < 1e-12, "{by_spacing:?}");
        let by_residual = Radii::new(&scans, Some(2e-3), &params);
        assert!((by_residual.noise - 8e-3).abs() < 1e-12, "{by_residual:?}");
        params.noise_radius = 4e-3;
        params.reduction_radius = 3e-3;
        assert_eq!(Radii::new(&scans, Some(1.0), &params), Radii { noise: 4e-3, reduction: 3e-3 });
    }
}
