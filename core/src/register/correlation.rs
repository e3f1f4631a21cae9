//! How much neighbouring measurements of one scan repeat each other.
//!
//! Matching windows of a stereo pair, and the wander of an arm during a sweep, shift whole patches at once. Averages
//! over such measurements are less certain than their number suggests, by the factor
//!
//! ```text
//! 1 / (1 + sum over neighbours of their correlation)                                            (1)
//! ```
//!
//! (the effective sample size; the sum ends where the correlation has died out, as in Geyer 1992, Practical Markov
//! Chain Monte Carlo, §3.3).

use super::surfels::{Surfels, Term};
use rayon::prelude::*;

/// Measurements of a scan whose neighbours are looked at: with a score of scans, enough for a few per cent.
const PROBES: usize = 150;
/// Widths of the bins of distance, and how many there are, in distances between surfels.
const BINS: usize = 16;
/// Correlations below this are none.
const LEAST: f64 = 0.05;

/// The factor (1) for the residuals of `terms` (one list a scan), estimated from all scans together.
pub(crate) fn effective_share(surfels: &Surfels, terms: &[Vec<Term>]) -> f64 {
    let sums: Vec<Sums> = terms.par_iter().map(|terms| Sums::of(surfels, terms)).collect();
    let mut all = Sums::default();
    for sums in &sums {
        all.probes += sums.probes;
        all.square += sums.square;
        for (sum, more) in all.products.iter_mut().zip(&sums.products) {
            sum.0 += more.0;
            sum.1 += more.1;
        }
    }
    all.share()
}

/// Sums over the probes of one or more scans.
#[derive(Default)]
struct Sums {
    probes: f64,
    square: f64,
    /// Sum of products with the neighbours in each bin of distance, and their number.
    products: [(f64, f64); BINS],
}

impl Sums {
    fn of(surfels: &Surfels, terms: &[Term]) -> Sums {
        let mut sums = Sums::default();
        let stride = terms.len().div_ceil(PROBES).max(1);
        for probe in terms.iter().step_by(stride) {
            let center = &surfels.centers[probe.surfel as usize];
            sums.probes += 1.0;
            sums.square += probe.residual * probe.residual;
            for term in terms.iter().filter(|t| t.surfel != probe.surfel) {
                let distance = (surfels.centers[term.surfel as usize] - center).norm();
                let bin = (distance / surfels.edge) as usize;
                if let Some(sum) = sums.products.get_mut(bin) {
                    sum.0 += probe.residual * term.residual;
                    sum.1 += 1.0;
                }
            }
        }
        sums
    }

    fn share(&self) -> f64 {
        let variance = self.square / self.probes;
        if variance.is_nan() || variance <= 0.0 {
            return 1.0;
        }
        let mut sum = 0.0;
        for (product, count) in self.products {
            if count == 0.0 {
                continue;
            }
            if product / count < LEAST * variance {
                break;
            }
            sum += product / self.probes / variance;
        }
        1.0 / (1.0 + sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Twist, Vec3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const SIDE: usize = 40;

    /// A square of surfels a metre apart, and twenty scans of it: white noise averaged over `block` x `block` surfels.
    fn scans(block: usize) -> (Surfels, Vec<Vec<Term>>) {
        let centers = (0..SIDE * SIDE)
            .map(|i| Vec3::new((i % SIDE) as f64, (i / SIDE) as f64, 0.0))
            .collect();
        let surfels = Surfels::of(centers, vec![Vec3::z(); SIDE * SIDE], 1.0);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut scan = || {
            let wide = SIDE + block;
            let white: Vec<f64> = (0..wide * wide).map(|_| rng.random_range(-1.0..1.0)).collect();
            let residual = |i: usize| -> f64 {
                let (x, y) = (i % SIDE, i / SIDE);
                (0..block * block).map(|k| white[(y + k / block) * wide + x + k % block]).sum()
            };
            let term = |i: usize| Term {
                surfel: i as u32,
                weight: 1.0,
                residual: residual(i),
                jacobian: Twist::zeros(),
                variance: 0.0,
            };
            (0..SIDE * SIDE).map(term).collect::<Vec<Term>>()
        };
        let terms = (0..20).map(|_| scan()).collect();
        (surfels, terms)
    }

    #[test]
    fn white_noise_counts_in_full() {
        let (surfels, terms) = scans(1);
        let share = effective_share(&surfels, &terms);
        assert!((share - 1.0).abs() < 0.05, "{share}");
    }

    #[test]
    fn a_moving_average_counts_as_one_of_its_window() {
        // The correlations of a window of 4 x 4 add up to 4 x 4.
        let (surfels, terms) = scans(4);
        let share = effective_share(&surfels, &terms);
        assert!((share * 16.0 - 1.0).abs() < 0.25, "{share}");
    }
}
