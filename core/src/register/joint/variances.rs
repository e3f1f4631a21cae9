//! Robust statistics of the heights that the scans measured of the surfels.

use super::surfels::SurfelMeasurement;
use crate::geometry::median;
use crate::register::align::factors::MAD_PER_SIGMA;

/// A surfel measurement shows the scatter of the points within it only if it is the mean of more
/// points than this.
const MIN_POINTS_FOR_SCATTER: f64 = 2.0;
/// The variance between scans is at least this share of the whole: it limits how exact a
/// measurement becomes by more points alone.
const MIN_SHARE_BETWEEN: f64 = 0.05;
/// The variance between scans is at least this times the squared noise floor, so that it is
/// positive without redundant measurements.
const MIN_VARIANCE_RATIO: f64 = 1e-4;

/// The mean height of a surfel.
#[derive(Clone, Copy, Default)]
pub(super) struct MeanHeight {
    /// Mean over the scans that measured it, metres.
    pub height: f64,
    /// How many scans measured it.
    pub scans: f64,
}

/// Components of the variance of a surfel's measured height, square metres.
#[derive(Clone, Copy)]
pub(super) struct Variances {
    /// Variance that all points of one measurement have in common.
    pub between: f64,
    /// Variance of a single point about the mean of its measurement.
    pub within: f64,
}

impl Variances {
    /// Estimated from all scans' measurements; `noise_floor` (metres) is the least noise believed.
    pub(super) fn estimate(
        measurements: &[Vec<SurfelMeasurement>],
        heights: &[MeanHeight],
        noise_floor: f64,
    ) -> Variances {
        let (mut square, mut degrees_of_freedom) = (0.0, 0.0);
        for measurement in with_scatter(measurements) {
            square += measurement.variance * measurement.weight;
            degrees_of_freedom += measurement.weight - 1.0;
        }
        let within = square / f64::max(degrees_of_freedom, 1.0);
        let (mut square, mut white, mut count) = (0.0, 0.0, 0.0);
        for (deviation, measurement) in deviations(measurements, heights) {
            square += deviation * deviation;
            white += within / measurement.weight;
            count += 1.0;
        }
        let total = square / f64::max(count, 1.0);
        let between = (total - white / f64::max(count, 1.0))
            .max(MIN_SHARE_BETWEEN * total)
            .max(MIN_VARIANCE_RATIO * noise_floor * noise_floor);
        Variances { between, within }
    }

    /// Variance of a measurement that is the mean of `points` points, square metres.
    pub(super) fn of_mean(&self, points: f64) -> f64 {
        self.between + self.within / points
    }
}

/// The mean height of each of `count` surfels over the scans that measured it.
pub(super) fn mean_heights(
    measurements: &[Vec<SurfelMeasurement>],
    count: usize,
) -> Vec<MeanHeight> {
    let mut heights = vec![MeanHeight::default(); count];
    for measurement in measurements.iter().flatten() {
        let sum = &mut heights[measurement.surfel as usize];
        sum.height += measurement.residual;
        sum.scans += 1.0;
    }
    for mean in &mut heights {
        mean.height /= f64::max(mean.scans, 1.0);
    }
    heights
}

/// Deviations of the scans' measurements from the mean of all (metres), scaled to the deviation of
/// one scan alone: `n` measurements scatter about their own mean by `(n - 1) / n` of their
/// variance. Surfels that one scan alone measured have no deviation.
pub(super) fn deviations<'a>(
    measurements: &'a [Vec<SurfelMeasurement>],
    heights: &'a [MeanHeight],
) -> impl Iterator<Item = (f64, &'a SurfelMeasurement)> {
    measurements.iter().flatten().filter_map(|measurement| {
        let MeanHeight { height, scans } = heights[measurement.surfel as usize];
        (scans > 1.0).then(|| {
            ((measurement.residual - height) * (scans / (scans - 1.0)).sqrt(), measurement)
        })
    })
}

/// Robust standard deviation of a single point about the surface, metres; 0 without redundant
/// measurements.
pub(super) fn point_sigma(measurements: &[Vec<SurfelMeasurement>], surfels: usize) -> f64 {
    let heights = mean_heights(measurements, surfels);
    let absolute = deviations(measurements, &heights).map(|(deviation, _)| deviation.abs());
    let mad = median(absolute.collect()).unwrap_or(0.0);
    let within = median(with_scatter(measurements).map(|m| m.variance).collect()).unwrap_or(0.0);
    (mad / MAD_PER_SIGMA).hypot(within.sqrt())
}

/// The measurements that are means of enough points to show their scatter.
fn with_scatter(
    measurements: &[Vec<SurfelMeasurement>],
) -> impl Iterator<Item = &SurfelMeasurement> {
    measurements.iter().flatten().filter(|m| m.weight > MIN_POINTS_FOR_SCATTER)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Twist, Vec3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    fn measurement(surfel: u32, weight: f64, residual: f64, variance: f64) -> SurfelMeasurement {
        let (position, normal) = (Vec3::zeros(), Vec3::z());
        let jacobian = Twist::zeros();
        SurfelMeasurement { surfel, weight, residual, jacobian, variance, position, normal }
    }

    #[test]
    fn heights_are_means_over_scans_and_deviations_are_those_of_one_scan() {
        // Surfel 0 is measured by three scans, surfel 2 by one, surfel 1 by none.
        let measurements = vec![
            vec![measurement(0, 5.0, 1.0, 0.0), measurement(2, 5.0, 7.0, 0.0)],
            vec![measurement(0, 5.0, 2.0, 0.0)],
            vec![measurement(0, 5.0, 6.0, 0.0)],
        ];
        let heights = mean_heights(&measurements, 3);
        let found: Vec<(f64, f64)> = heights.iter().map(|h| (h.height, h.scans)).collect();
        assert_eq!(found, [(3.0, 3.0), (0.0, 0.0), (7.0, 1.0)]);
        let expected = [-2.0, -1.0, 3.0].map(|d: f64| d * 1.5_f64.sqrt());
        let found: Vec<f64> = deviations(&measurements, &heights).map(|(d, _)| d).collect();
        assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
    }

    #[test]
    fn the_variances_of_two_components_are_recovered() {
        // Forty scans measure fifty surfels by ten points each. Points scatter by 3, and each mean
        // is shifted by 2 besides.
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let mut measurements = Vec::new();
        for _ in 0..40 {
            let mut scan = Vec::new();
            for surfel in 0..50 {
                let shift = 2.0 * rng.sample::<f64, _>(StandardNormal);
                let points: Vec<f64> =
                    (0..10).map(|_| shift + 3.0 * rng.sample::<f64, _>(StandardNormal)).collect();
                let mean = points.iter().sum::<f64>() / 10.0;
                let variance = points.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / 10.0;
                scan.push(measurement(surfel, 10.0, mean, variance));
            }
            measurements.push(scan);
        }
        let heights = mean_heights(&measurements, 50);
        let found = Variances::estimate(&measurements, &heights, 1e-3);
        assert!((found.within / 9.0 - 1.0).abs() < 0.05, "{}", found.within);
        assert!((found.between / 4.0 - 1.0).abs() < 0.1, "{}", found.between);
        assert_eq!(found.of_mean(3.0), found.between + found.within / 3.0);
        // Deviations of the means have the variance 4 + 9 / 10, the scatter within is 9 * 9 / 10.
        let sigma = point_sigma(&measurements, 50);
        assert!((sigma / 13_f64.sqrt() - 1.0).abs() < 0.05, "{sigma}");
    }

    #[test]
    fn without_redundancy_the_noise_floor_bounds_the_variance() {
        let measurements = vec![vec![measurement(0, 1.0, 5.0, 0.0)]];
        let heights = mean_heights(&measurements, 1);
        let found = Variances::estimate(&measurements, &heights, 0.1);
        assert_eq!((found.between, found.within), (MIN_VARIANCE_RATIO * 0.1 * 0.1, 0.0));
        assert_eq!(point_sigma(&measurements, 1), 0.0);
    }
}
