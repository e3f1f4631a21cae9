//! How much of their noise neighbouring measurements of one scan share.
//!
//! The matching windows of a stereo pair, and deviations of an arm during a sweep, shift whole
//! patches at once. Two measurements at the distance d across the line of sight share
//!
//! ```text
//! rho(0) = 1,    rho(d) = s exp(-(d / L)^2)                    (1)
//! ```
//!
//! of their variance: a Gaussian covariance with a nugget 1 - s (Cressie 1993, Statistics for
//! Spatial Data, §2.3), fitted to the correlogram of the residuals.

use crate::geometry::Vec3;
use rayon::prelude::*;

/// Measurements of a scan whose neighbours are evaluated, at most: with twenty scans, enough to
/// know the correlation to a few per cent.
const MAX_PROBES: usize = 150;
/// Number of bins of the correlogram.
const BIN_COUNT: usize = 24;
/// The nugget is at least this: a smooth covariance predicts small differences of neighbours too
/// well.
const MIN_NUGGET: f64 = 0.1;
/// A smaller share of the variance counts as no correlation.
const MIN_SHARE: f64 = 0.05;
/// Ratio of successive lengths that the fit tries.
const LENGTH_STEP_RATIO: f64 = 1.1;

/// Residuals of one scan.
#[derive(Clone, Debug, Default)]
pub(crate) struct Residuals {
    /// Positions across the line of sight, metres.
    pub positions: Vec<Vec3>,
    /// Residuals in standard deviations.
    pub values: Vec<f64>,
}

/// The correlation (1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Correlation {
    /// s, 0 to 1.
    pub share: f64,
    /// L, metres.
    pub length: f64,
}

impl Correlation {
    /// No correlation at all.
    pub(crate) const NONE: Correlation = Correlation { share: 0.0, length: 1.0 };

    /// Estimated from the residuals of all scans together, which lie about `spacing` (metres)
    /// apart.
    pub(crate) fn estimate(scans: &[Residuals], spacing: f64) -> Correlation {
        let correlograms: Vec<Correlogram> =
            scans.par_iter().map(|scan| Correlogram::from_residuals(scan, spacing)).collect();
        Correlogram::total(&correlograms).fit(spacing)
    }

    /// The number of independent measurements per measurement, where they lie `spacing` (metres)
    /// apart over a plane: 1 over the sum of rho over all neighbours (Cressie 1993, §1.3).
    pub(crate) fn independent_share(&self, spacing: f64) -> f64 {
        let redundant = self.share * std::f64::consts::PI * (self.length / spacing).powi(2);
        1.0 / (1.0 + redundant)
    }

    /// The correlation of normals that are fitted to measurements within `radius` (metres) of each
    /// other: besides their noise, they share neighbours.
    pub(crate) fn of_fitted_normals(&self, radius: f64) -> Correlation {
        Correlation { share: 1.0, length: radius.hypot(self.share.sqrt() * self.length) }
    }

    /// rho at a distance in metres.
    pub(crate) fn at(&self, distance: f64) -> f64 {
        if distance == 0.0 { 1.0 } else { self.share * gaussian(distance, self.length) } // (1)
    }
}

/// The Gaussian covariance of (1), 1 at the distance 0.
fn gaussian(distance: f64, length: f64) -> f64 {
    (-(distance / length).powi(2)).exp()
}

/// Products of the residuals of neighbours at similar distances.
#[derive(Clone, Copy, Default)]
struct ProductSum {
    sum: f64,
    count: f64,
}

/// A point of the empirical correlation function.
struct EmpiricalCorrelation {
    /// Metres.
    distance: f64,
    rho: f64,
    /// Number of pairs.
    count: f64,
}

/// Sums over the probes of one or more scans.
#[derive(Default)]
struct Correlogram {
    probes: f64,
    square_sum: f64,
    bins: [ProductSum; BIN_COUNT],
}

impl Correlogram {
    /// The sums of one scan; bins are `bin_width` (metres) wide.
    fn from_residuals(scan: &Residuals, bin_width: f64) -> Correlogram {
        let mut correlogram = Correlogram::default();
        let stride = scan.positions.len().div_ceil(MAX_PROBES).max(1);
        for probe in (0..scan.positions.len()).step_by(stride) {
            correlogram.probes += 1.0;
            correlogram.square_sum += scan.values[probe].powi(2);
            for (i, (position, value)) in scan.positions.iter().zip(&scan.values).enumerate() {
                let bin = ((position - scan.positions[probe]).norm() / bin_width) as usize;
                if let Some(products) = correlogram.bins.get_mut(bin).filter(|_| i != probe) {
                    products.sum += scan.values[probe] * value;
                    products.count += 1.0;
                }
            }
        }
        correlogram
    }

    fn total(correlograms: &[Correlogram]) -> Correlogram {
        let mut total = Correlogram::default();
        for correlogram in correlograms {
            total.probes += correlogram.probes;
            total.square_sum += correlogram.square_sum;
            for (sum, added) in total.bins.iter_mut().zip(&correlogram.bins) {
                sum.sum += added.sum;
                sum.count += added.count;
            }
        }
        total
    }

    /// Fits (1) by least squares over the bins, each weighted by its number of pairs.
    fn fit(&self, bin_width: f64) -> Correlation {
        let variance = self.square_sum / self.probes;
        if variance.is_nan() || variance <= 0.0 {
            return Correlation::NONE;
        }
        let empirical = self.correlations(variance, bin_width);
        let mut least_error = f64::INFINITY;
        let mut best = Correlation::NONE;
        let mut length = bin_width;
        // Beyond half of the correlogram, a length cannot be told from a constant.
        while length < BIN_COUNT as f64 * bin_width / 2.0 {
            let share = fit_share(&empirical, length);
            let error = squared_error(&empirical, share, length);
            if error < least_error {
                (least_error, best) = (error, Correlation { share, length });
            }
            length *= LENGTH_STEP_RATIO;
        }
        if best.share < MIN_SHARE { Correlation::NONE } else { best }
    }

    /// The empirical correlation in the middle of each bin that holds pairs.
    fn correlations(&self, variance: f64, bin_width: f64) -> Vec<EmpiricalCorrelation> {
        let bins = self.bins.iter().enumerate().filter(|(_, products)| products.count > 0.0);
        bins.map(|(i, products)| EmpiricalCorrelation {
            distance: (i as f64 + 0.5) * bin_width,
            rho: products.sum / products.count / variance,
            count: products.count,
        })
        .collect()
    }
}

/// The share s that fits best for a given length.
fn fit_share(empirical: &[EmpiricalCorrelation], length: f64) -> f64 {
    let (mut numerator, mut denominator) = (0.0, 0.0);
    for bin in empirical {
        let shape = gaussian(bin.distance, length);
        numerator += bin.count * bin.rho * shape;
        denominator += bin.count * shape.powi(2);
    }
    (numerator / denominator).clamp(0.0, 1.0 - MIN_NUGGET)
}

/// The weighted squared error of (1) over the bins.
fn squared_error(empirical: &[EmpiricalCorrelation], share: f64, length: f64) -> f64 {
    empirical
        .iter()
        .map(|bin| bin.count * (bin.rho - share * gaussian(bin.distance, length)).powi(2))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_correlogram_of_the_model_is_fitted_exactly() {
        // LENGTH_STEP_RATIO^10 is one of the lengths that the fit tries.
        let truth = Correlation { share: 0.6, length: 0.5 * LENGTH_STEP_RATIO.powi(10) };
        let mut correlogram =
            Correlogram { probes: 10.0, square_sum: 40.0, ..Correlogram::default() };
        for (i, bin) in correlogram.bins.iter_mut().enumerate() {
            bin.count = 5.0 + i as f64;
            bin.sum = 4.0 * bin.count * truth.at((i as f64 + 0.5) * 0.5);
        }
        let found = correlogram.fit(0.5);
        assert!((found.share - truth.share).abs() < 1e-9, "{found:?}");
        assert!((found.length - truth.length).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn the_independent_share_is_one_over_the_sum_of_rho() {
        let correlation = Correlation { share: 0.4, length: 6.0 };
        assert_eq!(Correlation::NONE.independent_share(1.0), 1.0);
        let mut sum = 0.0;
        for x in -30..=30 {
            for y in -30..=30 {
                sum += correlation.at(f64::from(x).hypot(f64::from(y)));
            }
        }
        // In the sum, the measurement itself counts 1, not s as in the integral over the plane.
        let expected = 1.0 / (sum + correlation.share);
        let found = correlation.independent_share(1.0);
        assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
    }
}
