//! Noise families and the chance that the sensors share.

use super::scene::Hit;
use crate::geometry::Vec3;
use crate::{Error, Result};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

crate::choice! {
    /// Noise of poses and sensor, after the benchmarks' table.
    pub enum NoiseFamily {
        /// Exact poses, laser striper.
        P1 = "P1",
        /// Poses of a KR 16 (0.1 to 0.3 mm, 0.01 to 0.03 degrees), laser striper.
        P2K = "P2K",
        /// Poses of an LWR (2 to 5 mm, 0.3 to 1 degree), laser striper.
        P2 = "P2",
        /// Poses of an LWR, stereo pair.
        P3 = "P3",
    }
}

impl NoiseFamily {
    /// The family of a set-up: `kr16_laser` or `omnirob_stereo`.
    ///
    /// # Errors
    /// [`Error::Input`] if there is no such set-up.
    pub fn of_setup(name: &str) -> Result<NoiseFamily> {
        match name {
            "kr16_laser" => Ok(NoiseFamily::P2K),
            "omnirob_stereo" => Ok(NoiseFamily::P3),
            _ => Err(Error::input(format!(
                "there is no set-up \"{name}\"; there are kr16_laser, omnirob_stereo"
            ))),
        }
    }

    /// Whether the sensor is the stereo pair; otherwise it is the laser striper.
    pub fn is_stereo(self) -> bool {
        self == NoiseFamily::P3
    }

    /// "laser" or "stereo", as a scan folder names it.
    pub fn sensor(self) -> &'static str {
        if self.is_stereo() { "stereo" } else { "laser" }
    }
}

/// What a random sequence is for; each use of each row has its own.
#[derive(Clone, Copy)]
pub(crate) enum Use {
    Sensor = 1,
    Correlated = 2,
    Sweep = 3,
    Robot = 4,
    Outliers = 5,
}

/// The source of all chance of one view.
#[derive(Clone, Copy)]
pub(crate) struct Dice {
    pub seed: u64,
    pub view: u64,
}

impl Dice {
    /// The sequence for `row` and `purpose`.
    pub(crate) fn rng(self, purpose: Use, row: usize) -> ChaCha8Rng {
        let numbers = [self.view, purpose as u64, row as u64];
        ChaCha8Rng::seed_from_u64(numbers.into_iter().fold(self.seed, mix))
    }
}

/// The finaliser of SplitMix64 (Steele et al. 2014, OOPSLA) over `state` moved on by `number`.
fn mix(state: u64, number: u64) -> u64 {
    let mut z = state.wrapping_add(number.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A standard normal number.
pub(crate) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    rng.sample(StandardNormal)
}

/// A direction evenly spread over the sphere.
pub(crate) fn direction(rng: &mut ChaCha8Rng) -> Vec3 {
    loop {
        let v = Vec3::new(normal(rng), normal(rng), normal(rng));
        if let Some(unit) = v.try_normalize(1e-6) {
            return unit;
        }
    }
}

/// Unit-variance Gaussian noise over a grid of rows of `width`, with correlation exp(-(d / length)^2) at the
/// distance d: white noise under a Gaussian kernel of standard deviation length / 2.
pub(crate) fn correlated(dice: Dice, width: usize, height: usize, length: f64) -> Vec<f64> {
    let reach = (2.0 * length).ceil() as usize;
    let kernel: Vec<f64> = (0..=2 * reach)
        .map(|i| (-2.0 * ((i as f64 - reach as f64) / length).powi(2)).exp())
        .collect();
    let norm = kernel.iter().map(|w| w * w).sum::<f64>().sqrt();
    let kernel: Vec<f64> = kernel.into_iter().map(|w| w / norm).collect();
    let along = |row: usize| -> Vec<f64> {
        let mut rng = dice.rng(Use::Correlated, row);
        let white: Vec<f64> = (0..width + 2 * reach).map(|_| normal(&mut rng)).collect();
        white
            .windows(kernel.len())
            .map(|w| w.iter().zip(&kernel).map(|(a, b)| a * b).sum())
            .collect()
    };
    let rows: Vec<Vec<f64>> = (0..height + 2 * reach).into_par_iter().map(along).collect();
    let across = |row: usize| -> Vec<f64> {
        (0..width)
            .map(|x| kernel.iter().enumerate().map(|(k, w)| rows[row + k][x] * w).sum())
            .collect()
    };
    let rows: Vec<Vec<f64>> = (0..height).into_par_iter().map(across).collect();
    rows.concat()
}

/// The side of a depth edge that a pixel sees too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Edge {
    /// No neighbour without a hit or beyond the threshold.
    None,
    /// The neighbour that differs most has this depth.
    Step(f64),
    /// A neighbour sees nothing.
    Void,
}

/// Looks for a depth edge between the hit `index` of a grid and its four neighbours: a difference in depth
/// beyond `threshold` (metres), or else a neighbour without a hit.
pub(crate) fn edge(hits: &[Option<Hit>], width: usize, index: usize, threshold: f64) -> Edge {
    let Some(hit) = &hits[index] else { return Edge::None };
    let (x, y, height) = (index % width, index / width, hits.len() / width);
    let neighbours = [
        (x > 0).then(|| index - 1),
        (x + 1 < width).then(|| index + 1),
        (y > 0).then(|| index - width),
        (y + 1 < height).then(|| index + width),
    ];
    let (mut found, mut largest) = (Edge::None, threshold);
    for neighbour in neighbours.into_iter().flatten() {
        match &hits[neighbour] {
            Some(other) if (other.depth - hit.depth).abs() > largest => {
                largest = (other.depth - hit.depth).abs();
                found = Edge::Step(other.depth);
            }
            None if found == Edge::None => found = Edge::Void,
            _ => {}
        }
    }
    found
}

/// The depth of a flying point: anywhere between both sides of the edge, or up to `tail` (metres) behind the
/// surface if there is nothing on the other side.
pub(crate) fn flying_depth(depth: f64, edge: Edge, tail: f64, rng: &mut ChaCha8Rng) -> f64 {
    let share: f64 = rng.random();
    match edge {
        Edge::None => depth,
        Edge::Step(other) => depth + share * (other - depth),
        Edge::Void => depth + share * tail,
    }
}
