//! Random numbers of the simulation, each use with a sequence of its own.

use crate::geometry::Vec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

/// What a random sequence is used for. Each use has its own sequence in each row of each view.
#[derive(Clone, Copy)]
pub(crate) enum RandomUse {
    Sensor = 1,
    CorrelatedNoise = 2,
    Sweep = 3,
    RobotPose = 4,
    AddedOutliers = 5,
}

/// The source of all random numbers of one view.
#[derive(Clone, Copy)]
pub(crate) struct RandomSource {
    pub seed: u64,
    pub view: u64,
}

impl RandomSource {
    /// The random sequence for a row and a use.
    pub(crate) fn rng(self, random_use: RandomUse, row: usize) -> ChaCha8Rng {
        let numbers = [self.view, random_use as u64, row as u64];
        ChaCha8Rng::seed_from_u64(numbers.into_iter().fold(self.seed, mix_seed))
    }
}

/// The finaliser of SplitMix64 (Steele et al. 2014, OOPSLA) over `state` moved on by `number`.
fn mix_seed(state: u64, number: u64) -> u64 {
    let mut z = state.wrapping_add(number.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Draws a standard normal number.
pub(crate) fn standard_normal(rng: &mut ChaCha8Rng) -> f64 {
    rng.sample(StandardNormal)
}

/// Draws a unit vector that is uniformly distributed over the sphere.
pub(crate) fn random_direction(rng: &mut ChaCha8Rng) -> Vec3 {
    loop {
        let v = Vec3::new(standard_normal(rng), standard_normal(rng), standard_normal(rng));
        if let Some(unit) = v.try_normalize(MIN_DIRECTION_NORM) {
            return unit;
        }
    }
}

/// A vector shorter than this is drawn again, since rounding would dominate its direction.
const MIN_DIRECTION_NORM: f64 = 1e-6;

/// Gaussian noise of unit variance over a grid of `height` rows of `width`, row by row. Its
/// correlation at the distance d is exp(-(d / length)^2): white noise under a Gaussian kernel of
/// standard deviation length / 2. `length` and d are in pixels of the grid.
pub(crate) fn correlated_noise(
    source: RandomSource,
    width: usize,
    height: usize,
    length: f64,
) -> Vec<f64> {
    let kernel = gaussian_kernel(length);
    let margin = kernel.len() - 1;
    let smoothed_rows: Vec<Vec<f64>> = (0..height + margin)
        .into_par_iter()
        .map(|row| {
            let mut rng = source.rng(RandomUse::CorrelatedNoise, row);
            let white: Vec<f64> = (0..width + margin).map(|_| standard_normal(&mut rng)).collect();
            white
                .windows(kernel.len())
                .map(|w| w.iter().zip(&kernel).map(|(a, b)| a * b).sum())
                .collect()
        })
        .collect();
    let rows: Vec<Vec<f64>> = (0..height)
        .into_par_iter()
        .map(|row| {
            (0..width)
                .map(|x| {
                    kernel.iter().enumerate().map(|(k, w)| smoothed_rows[row + k][x] * w).sum()
                })
                .collect()
        })
        .collect();
    rows.concat()
}

/// A Gaussian kernel of standard deviation `length` / 2, cut off at four standard deviations, whose
/// weights have squares that add up to 1.
fn gaussian_kernel(length: f64) -> Vec<f64> {
    let reach = (2.0 * length).ceil() as usize;
    let kernel: Vec<f64> = (0..=2 * reach)
        .map(|i| (-2.0 * ((i as f64 - reach as f64) / length).powi(2)).exp())
        .collect();
    let norm = kernel.iter().map(|w| w * w).sum::<f64>().sqrt();
    kernel.into_iter().map(|w| w / norm).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlated_noise_has_unit_variance_and_the_stated_correlation() {
        let (width, height, length) = (200, 150, 4.0);
        let source = RandomSource { seed: 3, view: 0 };
        let noise = correlated_noise(source, width, height, length);
        assert_eq!(noise.len(), width * height);
        for (columns, rows) in [(0usize, 0usize), (2, 0), (0, 4), (3, 3), (12, 0)] {
            let (mut sum, mut count) = (0.0, 0.0);
            for y in 0..height - rows {
                for x in 0..width - columns {
                    sum += noise[y * width + x] * noise[(y + rows) * width + x + columns];
                    count += 1.0;
                }
            }
            let squared_distance = (columns * columns + rows * rows) as f64;
            let expected = (-squared_distance / (length * length)).exp();
            let actual: f64 = sum / count;
            assert!((actual - expected).abs() < 0.06, "{columns} {rows}: {actual} {expected}");
        }
    }

    #[test]
    fn directions_are_unit_vectors_spread_evenly_over_the_sphere() {
        let mut rng = RandomSource { seed: 1, view: 2 }.rng(RandomUse::RobotPose, 0);
        let (mut mean, mut second) = (Vec3::zeros(), nalgebra::Matrix3::zeros());
        for _ in 0..20_000 {
            let direction = random_direction(&mut rng);
            assert!((direction.norm() - 1.0).abs() < 1e-12);
            mean += direction / 20_000.0;
            second += direction * direction.transpose() / 20_000.0;
        }
        assert!(mean.norm() < 0.02, "{mean}");
        assert!((second - nalgebra::Matrix3::identity() / 3.0).norm() < 0.02, "{second}");
    }

    #[test]
    fn each_use_row_and_view_has_a_sequence_of_its_own() {
        let mut firsts = Vec::new();
        for view in 0..3 {
            for random_use in [RandomUse::Sensor, RandomUse::Sweep, RandomUse::AddedOutliers] {
                for row in 0..4 {
                    let mut rng = RandomSource { seed: 5, view }.rng(random_use, row);
                    firsts.push(rng.random::<u64>());
                }
            }
        }
        let again = RandomSource { seed: 5, view: 0 }.rng(RandomUse::Sensor, 0).random::<u64>();
        assert_eq!(again, firsts[0]);
        firsts.sort_unstable();
        firsts.dedup();
        assert_eq!(firsts.len(), 36);
    }
}
