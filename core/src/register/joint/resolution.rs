//! How finely the joint optimisation resolves the surface.

use crate::geometry::median;
use crate::register::registration_scan::RegistrationScan;

/// The spacing and the search distance shrink by this factor in each iteration, until they are the
/// finest.
const SHRINK_RATIO: f64 = 0.6;
/// Surfels along the diagonal of the largest scan, at most: finer ones cost time and add no
/// information.
const MAX_SURFELS_ALONG_DIAGONAL: f64 = 64.0;
/// Spacing of the surfels in distances between the points of the map: each is then the mean of
/// about six points.
const SURFEL_SPACING_RATIO: f64 = 2.5;
/// Spacing of the surfels in standard deviations of the noise, at least: between smaller ones noise
/// would look like curvature.
const MIN_SPACING_SIGMA: f64 = 3.0;
/// Search distance in standard deviations of the noise, at least: all good measurements are in
/// reach.
const MIN_REACH_SIGMA: f64 = 6.0;
/// Noise and distance between points where no scan states any, metres.
const DEFAULT_LENGTH_M: f64 = 1e-3;

/// The resolution of one iteration.
#[derive(Clone, Copy)]
pub(super) struct Resolution {
    /// Distance between surfels, metres.
    pub spacing: f64,
    /// Distance from the surface within which measurements count, metres.
    pub reach: f64,
}

impl Resolution {
    /// The finest resolution that the point density and the noise of the scans allow.
    pub(super) fn finest(scans: &[&RegistrationScan]) -> Resolution {
        let point_spacing = median_over(scans, |scan| scan.map_spacing);
        let noise = median_over(scans, |scan| scan.noise);
        let extent = scans.iter().map(|scan| scan.extent).fold(0.0, f64::max);
        let spacing = (SURFEL_SPACING_RATIO * point_spacing)
            .max(MIN_SPACING_SIGMA * noise)
            .max(extent / MAX_SURFELS_ALONG_DIAGONAL);
        Resolution { spacing, reach: spacing.max(MIN_REACH_SIGMA * noise) }
    }

    /// A resolution that is coarser by `factor`.
    pub(super) fn coarser(self, factor: f64) -> Resolution {
        Resolution { spacing: self.spacing * factor, reach: self.reach * factor }
    }

    /// The resolution of the next iteration, at most as fine as `finest`.
    pub(super) fn refined(self, finest: &Resolution) -> Resolution {
        Resolution {
            spacing: (self.spacing * SHRINK_RATIO).max(finest.spacing),
            reach: (self.reach * SHRINK_RATIO).max(finest.reach),
        }
    }
}

/// The median over the scans of a length in metres.
fn median_over(scans: &[&RegistrationScan], length: fn(&RegistrationScan) -> f64) -> f64 {
    median(scans.iter().map(|scan| length(scan)).collect()).unwrap_or(DEFAULT_LENGTH_M)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_resolution_is_refined_until_it_is_the_finest() {
        let finest = Resolution { spacing: 1.0, reach: 2.0 };
        let mut resolution = finest.coarser(4.0);
        assert_eq!((resolution.spacing, resolution.reach), (4.0, 8.0));
        let mut spacings = Vec::new();
        for _ in 0..4 {
            resolution = resolution.refined(&finest);
            spacings.push(resolution.spacing);
        }
        let expected = [2.4, 1.44, 1.0, 1.0];
        assert!(spacings.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{spacings:?}");
        assert_eq!(resolution.reach, finest.reach);
    }
}
