//! Scans whose noise is a moving average, and the correlation that is found in it.

use super::correlation::{Correlation, Residuals};
use crate::geometry::Vec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Measurements in a row and in a column of a scan.
const GRID_SIDE: usize = 40;

/// Twenty scans of a square of measurements a metre apart, whose residuals are white noise
/// averaged over `block` x `block`, of unit variance.
pub(super) fn moving_averages(block: usize) -> Vec<Residuals> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    (0..20).map(|_| moving_average(block, &mut rng)).collect()
}

fn moving_average(block: usize, rng: &mut ChaCha8Rng) -> Residuals {
    let wide = GRID_SIDE + block;
    let white: Vec<f64> =
        (0..wide * wide).map(|_| 3.0_f64.sqrt() * rng.random_range(-1.0..1.0)).collect();
    let mut residuals = Residuals::default();
    for i in 0..GRID_SIDE * GRID_SIDE {
        let (x, y) = (i % GRID_SIDE, i / GRID_SIDE);
        let window = (0..block * block).map(|k| white[(y + k / block) * wide + x + k % block]);
        residuals.positions.push(Vec3::new(x as f64, y as f64, 0.0));
        residuals.values.push(window.sum::<f64>() / block as f64);
    }
    residuals
}

#[test]
fn white_noise_has_no_correlation() {
    assert_eq!(Correlation::estimate(&moving_averages(1), 1.0), Correlation::NONE);
}

#[test]
fn a_moving_average_is_correlated_over_its_window() {
    // Its correlogram falls linearly from 1 to 0 at 4 in each direction: to 0.5 at a distance
    // of 2.
    let found = Correlation::estimate(&moving_averages(4), 1.0);
    assert!((found.at(2.0) - 0.5).abs() < 0.12, "{found:?}");
    assert!(found.at(1.0) > 0.65 && found.at(5.0) < 0.1, "{found:?}");
}
