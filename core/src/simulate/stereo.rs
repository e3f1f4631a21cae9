//! Stereo pair: two cameras of 1292 x 964 pixels, side by side along x, matched on a grid of 320 x 240.
//!
//! The sensor frame is the left camera's. Depth is z = f b / d with focal length f (pixels), baseline b and
//! disparity d, so a disparity error s gives z^2 / (f b) s: at 0.65 m 1.3 mm for the noise below.

use super::labels::{FLYING, GOOD, OUTLIER};
use super::noise::{Dice, Edge, Use, correlated, edge, flying_depth, normal};
use super::scene::{Hit, Scene};
use super::{SimulateParams, f32s};
use crate::geometry::{Pose, Scan, StereoModel, Vec3};
use rand::RngExt;
use rayon::prelude::*;

/// The pair that is simulated.
const MODEL: StereoModel = StereoModel::GUPPY;
const GRID: [usize; 2] = MODEL.grid;
const IMAGE: [f64; 2] = MODEL.image;
const BASELINE: f64 = MODEL.baseline;
/// Standard deviation of the disparity seen head on, pixels of the image: white, and correlated over the
/// matching window.
const WHITE: f64 = 0.25;
const CORRELATED: f64 = 0.5;
/// Disparity noise grows with this power of 1 / cos of the incidence: a slanted surface is matched over a
/// foreshortened window. Chosen so that raw points are as far from the surface as in the benchmarks' table.
const SLANT: f64 = 1.5;
/// Distance at which the correlated part's correlation is 1/e, pixels of the grid.
const CORRELATION_LENGTH: f64 = 6.0;
/// Step of the sub-pixel matching, pixels of the image.
const QUANTUM: f64 = 1.0 / 16.0;
/// Smaller disparities are not looked for, pixels of the image.
const LEAST_DISPARITY: f64 = 2.0;
/// Share of outliers.
pub(super) const OUTLIERS: f64 = 0.01;
/// Outliers lie this much nearer or farther than the object can, metres.
const OUTLIER_MARGIN: f64 = 0.05;
/// Depth difference between neighbours that makes an edge, metres; a slope of 75 degrees stays below.
const EDGE: f64 = 8e-3;
/// Share of edge pixels that fly.
const FLYING_SHARE: f64 = 0.5;
/// How far a flying point lies behind the edge if there is nothing behind, metres: some grid pixels.
const TAIL: f64 = 20e-3;
/// Incidence from which on points drop out, and past which there are none, degrees.
const DROP_OUT: [f64; 2] = [50.0, 75.0];

/// The pair for an object; large ones are kept off by three radii.
pub(crate) fn model_for(scene: &Scene, params: &SimulateParams) -> StereoModel {
    StereoModel {
        working_distance: params.stereo_distance.max(3.0 * scene.radius()),
        range: [0.0, f64::INFINITY],
        ..MODEL
    }
}

/// Focal length, pixels of the image.
fn focal_length() -> f64 {
    MODEL.focal_length()
}

/// The ray of a pixel of the grid, scaled to z = 1.
fn ray(index: usize) -> Vec3 {
    MODEL.ray((index % GRID[0]) as f64, (index / GRID[0]) as f64)
}

/// One pair of images from `object_from_sensor`: the scan, labels and noise-free hits.
pub(crate) fn scan(
    scene: &Scene,
    model: &StereoModel,
    object_from_sensor: &Pose,
    dice: Dice,
) -> (Scan, Vec<u8>, Vec<[f32; 3]>) {
    let cast = |index: usize| {
        let right = Vec3::x() * BASELINE;
        let hit = scene.hit(object_from_sensor, &Vec3::zeros(), &ray(index).normalize(), &right)?;
        let shift = focal_length() * (hit.point.x - BASELINE) / hit.point.z;
        // Beside the right image there is nothing to match.
        (shift.abs() <= IMAGE[0] / 2.0).then_some(Hit { depth: hit.point.z, ..hit })
    };
    let hits: Vec<Option<Hit>> = (0..GRID[0] * GRID[1]).into_par_iter().map(cast).collect();
    let matcher = Matcher {
        hits: &hits,
        drift: correlated(dice, GRID[0], GRID[1], CORRELATION_LENGTH),
        middle: model.working_distance,
        range: model.range,
        reach: scene.radius() + OUTLIER_MARGIN,
    };
    let rows: Vec<Vec<([f32; 3], u8)>> =
        (0..GRID[1]).into_par_iter().map(|row| matcher.row(row, dice)).collect();
    let (points, labels): (Vec<[f32; 3]>, Vec<u8>) = rows.concat().into_iter().unzip();
    let truth = |(hit, point): (&Option<Hit>, &[f32; 3])| match hit {
        Some(hit) if point[0].is_finite() => f32s(&hit.point),
        _ => [f32::NAN; 3],
    };
    let hits = hits.iter().zip(&points).map(truth).collect();
    (Scan { points, width: GRID[0], origins: Vec::new() }, labels, hits)
}

/// What the matching works on.
struct Matcher<'a> {
    hits: &'a [Option<Hit>],
    /// Correlated noise, unit variance.
    drift: Vec<f64>,
    /// Outliers lie within `reach` of this depth, metres.
    middle: f64,
    reach: f64,
    /// Nearest and farthest depth, metres.
    range: [f64; 2],
}

impl Matcher<'_> {
    fn row(&self, row: usize, dice: Dice) -> Vec<([f32; 3], u8)> {
        let mut rng = dice.rng(Use::Sensor, row);
        let mut measure = |index: usize| {
            let none = ([f32::NAN; 3], GOOD);
            let Some(hit) = &self.hits[index] else { return none };
            if rng.random_bool(drop_out(hit.cosine)) {
                return none;
            }
            let edge = edge(self.hits, GRID[0], index, EDGE);
            let (mut depth, mut label) = (hit.depth, hit.label());
            if rng.random_bool(OUTLIERS) {
                depth = self.middle + rng.random_range(-1.0..1.0) * self.reach;
                label = OUTLIER;
            } else if edge != Edge::None && rng.random_bool(FLYING_SHARE) {
                depth = flying_depth(depth, edge, TAIL, &mut rng);
                label = FLYING;
            }
            let noise = WHITE * normal(&mut rng) + CORRELATED * self.drift[index];
            let disparity = focal_length() * BASELINE / depth + noise / hit.cosine.powf(SLANT);
            let disparity = (disparity / QUANTUM).round() * QUANTUM;
            let measured = focal_length() * BASELINE / disparity;
            if disparity < LEAST_DISPARITY || !(self.range[0]..=self.range[1]).contains(&measured) {
                return none;
            }
            (f32s(&(ray(index) * measured)), label)
        };
        (row * GRID[0]..(row + 1) * GRID[0]).map(&mut measure).collect()
    }
}

/// Standard deviation of the depth, metres, at a depth (metres) and cosine of incidence.
pub(super) fn sigma(depth: f64, cosine: f64) -> f64 {
    // Rounding to a step adds the variance of a uniform error.
    let rounding = QUANTUM * QUANTUM / 12.0;
    let matching = (WHITE * WHITE + CORRELATED * CORRELATED) / cosine.powf(2.0 * SLANT);
    depth * depth / (focal_length() * BASELINE) * (matching + rounding).sqrt()
}

/// Correlation of the depth errors of two pixels so many columns and rows apart.
pub(super) fn correlation(columns: f64, rows: f64) -> f64 {
    let share = CORRELATED * CORRELATED / (WHITE * WHITE + CORRELATED * CORRELATED);
    share * (-(columns * columns + rows * rows) / (CORRELATION_LENGTH * CORRELATION_LENGTH)).exp()
}

/// Probability that a point is lost: none up to 50 degrees of incidence, all from 75 on, linear between.
fn drop_out(cosine: f64) -> f64 {
    let degrees = cosine.clamp(0.0, 1.0).acos().to_degrees();
    ((degrees - DROP_OUT[0]) / (DROP_OUT[1] - DROP_OUT[0])).clamp(0.0, 1.0)
}

#[cfg(test)]
#[path = "stereo_tests.rs"]
mod tests;
