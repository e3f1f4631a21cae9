//! How many standard deviations off the surface make a measurement an outlier.

use std::f64::consts::PI;

/// The threshold for measurements that have a normal, in standard deviations: few of them are
/// outliers.
pub(super) const MAX_ORIENTED_SIGMAS: f64 = 4.5;
/// The least threshold for the others.
const MIN_UNORIENTED_SIGMAS: f64 = 2.0;
/// Wanted share of good measurements among those that are called outliers, if good ones were
/// normally distributed to the ends. Their tails are some times heavier.
const FALSE_DISCOVERY_RATE: f64 = 0.005;
/// Standard deviations beyond which there are only outliers.
const MIN_OUTLIER_SIGMAS: f64 = 6.0;
/// Bounds of the share of good measurements beyond the threshold, within which [`normal_quantile`]
/// is accurate.
const TAIL_BOUNDS: [f64; 2] = [1e-9, 0.1];
/// Iterations of the quantile: each gains about a digit.
const QUANTILE_ITERATIONS: usize = 20;

/// A measurement and how far it is off the surface.
pub(super) struct ScoredMeasurement {
    /// Index in the raw scan.
    pub source: u32,
    /// Whether the scan alone gave it a normal.
    pub is_oriented: bool,
    /// Distance from the surface in standard deviations; infinite if there is no surface beside it.
    pub sigmas: f64,
}

/// The threshold for measurements without a normal, in standard deviations: so large that few of
/// those beyond it are good (false discovery rate).
///
/// Good ones lie off their neighbours and scatter more than others. They are taken as normally
/// distributed with a scale that follows from how many lie near the surface, where outliers are few
/// (empirical null; Efron 2010, Large-scale inference, ch. 6).
pub(super) fn unoriented_threshold(scored: &[Vec<ScoredMeasurement>]) -> f64 {
    let unoriented = scored.iter().flatten().filter(|m| !m.is_oriented);
    let sigmas: Vec<f64> = unoriented.map(|m| m.sigmas).collect();
    let outliers = sigmas.iter().filter(|s| **s >= MIN_OUTLIER_SIGMAS).count();
    // The logarithm of a normal density falls by x^2 / 2. The middles of the two classes are 1/2
    // and 3/2, so that it falls by 1 between them if the scale is 1, and else by scale^-2.
    let first = count_between(&sigmas, 0.0, 1.0).max(1.0);
    let second = count_between(&sigmas, 1.0, 2.0).max(1.0);
    let fall = (first / second).ln();
    let scale = if fall > 0.0 { fall.powf(-0.5).max(1.0) } else { f64::INFINITY };
    let good = count_between(&sigmas, 0.0, MIN_OUTLIER_SIGMAS).max(1.0);
    let tail =
        (FALSE_DISCOVERY_RATE * outliers as f64 / good).clamp(TAIL_BOUNDS[0], TAIL_BOUNDS[1]);
    (scale * normal_quantile(tail)).clamp(MIN_UNORIENTED_SIGMAS, MAX_ORIENTED_SIGMAS)
}

/// Number of `values` in `low..high`.
fn count_between(values: &[f64], low: f64, high: f64) -> f64 {
    values.iter().filter(|value| (low..high).contains(*value)).count() as f64
}

/// The size that standard normal numbers exceed with probability `tail`, on both sides together, by
/// fixed-point iteration of Mills' ratio. It is accurate to a hundredth for tails below a tenth.
///
/// ```text
/// tail = sqrt(2 / pi) exp(-x^2 / 2) M(x),   M(x) = 1 / (x + 0.8 / (x + 1))                     (1)
/// ```
fn normal_quantile(tail: f64) -> f64 {
    let density = (2.0 / PI).sqrt() / tail;
    let mut x = 2.0;
    for _ in 0..QUANTILE_ITERATIONS {
        x = (2.0 * (density / (x + 0.8 / (x + 1.0))).ln()).max(1.0).sqrt(); // (1)
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quantile_is_that_of_tables() {
        for (tail, expected) in [(0.1, 1.645), (0.05, 1.960), (0.01, 2.576), (6.3e-5, 4.0)] {
            let found = normal_quantile(tail);
            assert!((found - expected).abs() < 0.03, "{tail}: {found}");
        }
    }

    fn scored(sigmas: impl Iterator<Item = f64>) -> Vec<Vec<ScoredMeasurement>> {
        vec![
            sigmas
                .map(|sigmas| ScoredMeasurement { source: 0, is_oriented: false, sigmas })
                .collect(),
        ]
    }

    #[test]
    fn more_outliers_lower_the_threshold() {
        // 1,000 good ones in the classes of a normal distribution. The middles of the first two
        // give the scale ln(683 / 272)^-1/2 = 1.042.
        let good = [(0.5, 683), (1.5, 272), (2.5, 45)];
        let good: Vec<f64> =
            good.into_iter().flat_map(|(sigmas, count)| vec![sigmas; count]).collect();
        // Tails of 5e-6, 5e-4 and 0.05 begin at 4.56, 3.48 and 1.96 standard deviations.
        for (outliers, expected) in [(1, MAX_ORIENTED_SIGMAS), (100, 3.63), (10_000, 2.04)] {
            let all = good.iter().copied().chain(std::iter::repeat_n(10.0, outliers));
            let threshold = unoriented_threshold(&scored(all));
            assert!((threshold - expected).abs() < 0.05, "{outliers}: {threshold}");
        }
    }

    #[test]
    fn without_any_measurement_all_are_believed() {
        assert_eq!(unoriented_threshold(&[]), MAX_ORIENTED_SIGMAS);
    }
}
