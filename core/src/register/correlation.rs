//! How much neighbouring measurements of one scan repeat each other.
//!
//! Matching windows of a stereo pair, and the wander of an arm during a sweep, shift whole patches at once. Two
//! measurements at the distance d, seen from the sensor, share
//!
//! ```text
//! rho(0) = 1,    rho(d) = s exp(-(d / L)^2)                                                      (1)
//! ```
//!
//! of their variance: a Gaussian covariance with a nugget 1 - s (Cressie 1993, Statistics for Spatial Data, §2.3), fitted
//! to the correlogram of the residuals.

use crate::geometry::Vec3;
use rayon::prelude::*;

/// Measurements of a scan whose neighbours are looked at: with a score of scans, enough for a few per cent.
const PROBES: usize = 150;
/// Bins of the correlogram.
const BINS: usize = 24;
/// The nugget is at least this: what a smooth covariance says of small differences is believed no further.
const LEAST_NUGGET: f64 = 0.1;
/// A share of the variance below this is none.
const LEAST_SHARE: f64 = 0.05;
/// Lengths that are tried are this factor apart.
const LENGTH_STEP: f64 = 1.1;

/// Residuals of one scan, each at its place across the line of sight (metres), in standard deviations.
#[derive(Clone, Debug, Default)]
pub(crate) struct Residuals {
    pub at: Vec<Vec3>,
    pub value: Vec<f64>,
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

    /// Estimated from the residuals of all scans together, which lie about `spacing` (metres) apart.
    pub(crate) fn learn(scans: &[Residuals], spacing: f64) -> Correlation {
        let sums: Vec<Correlogram> =
            scans.par_iter().map(|scan| Correlogram::of(scan, spacing)).collect();
        Correlogram::total(&sums).fit(spacing)
    }

    /// Independent measurements for each one, where they lie `spacing` (metres) apart over a plane: 1 over the sum of
    /// rho over all neighbours (Cressie 1993, §1.3).
    pub(crate) fn independent_share(&self, spacing: f64) -> f64 {
        let alike = self.share * std::f64::consts::PI * (self.length / spacing).powi(2);
        1.0 / (1.0 + alike)
    }

    /// That of normals that are fitted to measurements within `radius` (metres) of each other: they
    /// share neighbours besides.
    pub(crate) fn of_normals(&self, radius: f64) -> Correlation {
        Correlation { share: 1.0, length: radius.hypot(self.share.sqrt() * self.length) }
    }

    /// rho at a distance, metres.
    pub(crate) fn at(&self, distance: f64) -> f64 {
        if distance == 0.0 { 1.0 } else { self.share * (-(distance / self.length).powi(2)).exp() }
    }
}

/// Sums over the probes of one or more scans.
#[derive(Default)]
struct Correlogram {
    probes: f64,
    square: f64,
    /// Sum of products with the neighbours in each bin of distance, and their number.
    products: [(f64, f64); BINS],
}

impl Correlogram {
    fn of(scan: &Residuals, width: f64) -> Correlogram {
        let mut sums = Correlogram::default();
        let stride = scan.at.len().div_ceil(PROBES).max(1);
        for probe in (0..scan.at.len()).step_by(stride) {
            sums.probes += 1.0;
            sums.square += scan.value[probe].powi(2);
            for (i, (at, value)) in scan.at.iter().zip(&scan.value).enumerate() {
                let bin = ((at - scan.at[probe]).norm() / width) as usize;
                if let Some(sum) = sums.products.get_mut(bin).filter(|_| i != probe) {
                    sum.0 += scan.value[probe] * value;
                    sum.1 += 1.0;
                }
            }
        }
        sums
    }

    fn total(sums: &[Correlogram]) -> Correlogram {
        let mut all = Correlogram::default();
        for sums in sums {
            all.probes += sums.probes;
            all.square += sums.square;
            for (sum, more) in all.products.iter_mut().zip(&sums.products) {
                sum.0 += more.0;
                sum.1 += more.1;
            }
        }
        all
    }

    /// Least squares over the bins, each counting by its number of pairs.
    fn fit(&self, width: f64) -> Correlation {
        let variance = self.square / self.probes;
        if variance.is_nan() || variance <= 0.0 {
            return Correlation::NONE;
        }
        let bins: Vec<(f64, f64, f64)> = (0..BINS)
            .filter(|&i| self.products[i].1 > 0.0)
            .map(|i| {
                let (product, count) = self.products[i];
                ((i as f64 + 0.5) * width, product / count / variance, count)
            })
            .collect();
        let mut best = (f64::INFINITY, Correlation::NONE);
        let mut length = width;
        while length < BINS as f64 * width / 2.0 {
            let shape = |d: f64| (-(d / length).powi(2)).exp();
            let (mut above, mut below) = (0.0, 0.0);
            for &(d, rho, count) in &bins {
                above += count * rho * shape(d);
                below += count * shape(d).powi(2);
            }
            let share = (above / below).clamp(0.0, 1.0 - LEAST_NUGGET);
            let miss: f64 =
                bins.iter().map(|&(d, rho, n)| n * (rho - share * shape(d)).powi(2)).sum();
            if miss < best.0 {
                best = (miss, Correlation { share, length });
            }
            length *= LENGTH_STEP;
        }
        if best.1.share < LEAST_SHARE { Correlation::NONE } else { best.1 }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const SIDE: usize = 40;

    /// A square of measurements a metre apart, and twenty scans of it: white noise averaged over `block` x `block`,
    /// of unit variance.
    pub(crate) fn scans(block: usize) -> Vec<Residuals> {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut scan = || {
            let wide = SIDE + block;
            let white: Vec<f64> =
                (0..wide * wide).map(|_| 3.0_f64.sqrt() * rng.random_range(-1.0..1.0)).collect();
            let value = |i: usize| -> f64 {
                let (x, y) = (i % SIDE, i / SIDE);
                let window =
                    (0..block * block).map(|k| white[(y + k / block) * wide + x + k % block]);
                window.sum::<f64>() / block as f64
            };
            let at = |i: usize| Vec3::new((i % SIDE) as f64, (i / SIDE) as f64, 0.0);
            Residuals {
                at: (0..SIDE * SIDE).map(at).collect(),
                value: (0..SIDE * SIDE).map(value).collect(),
            }
        };
        (0..20).map(|_| scan()).collect()
    }

    #[test]
    fn white_noise_has_none() {
        assert_eq!(Correlation::learn(&scans(1), 1.0), Correlation::NONE);
    }

    #[test]
    fn a_moving_average_is_correlated_over_its_window() {
        // Its correlogram falls linearly from 1 to 0 at 4 in each direction: to 0.5 at a distance of 2.
        let found = Correlation::learn(&scans(4), 1.0);
        assert!((found.at(2.0) - 0.5).abs() < 0.12, "{found:?}");
        assert!(found.at(1.0) > 0.65 && found.at(5.0) < 0.1, "{found:?}");
    }
}
