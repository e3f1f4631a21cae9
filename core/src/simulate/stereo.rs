//! Stereo pair: two cameras of 1292 x 964 pixels, side by side along x, matched on a grid of
//! 320 x 240.
//!
//! The sensor frame is the left camera's. Depth is z = f b / d with focal length f (pixels),
//! baseline b (metres) and disparity d (pixels), so a disparity error s gives a depth error of z^2
//! / (f b) s: at 0.65 m 1.3 mm for the noise below.

use super::depth_edge::{DepthEdge, draw_flying_depth, find_depth_edge};
use super::labels::{FLYING_LABEL, OUTLIER_LABEL};
use super::params::SimulateParams;
use super::random::{RandomSource, RandomUse, correlated_noise, standard_normal};
use super::scene::{Hit, SimulatedScene};
use super::sensor_output::{MeasuredPoint, NO_POINT, SensorOutput, single_precision};
use crate::geometry::{Pose, StereoModel, Vec3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// The pair that is simulated.
const MODEL: StereoModel = StereoModel::GUPPY;
/// Columns and rows of the grid on which disparities are matched.
const GRID_SIZE: [usize; 2] = MODEL.grid;
/// Columns and rows of an image, pixels.
const IMAGE_SIZE: [f64; 2] = MODEL.image;
/// Distance between the cameras, metres.
const BASELINE_M: f64 = MODEL.baseline;
/// Standard deviation of the part of the disparity noise that is white, at normal incidence, pixels
/// of the image.
const WHITE_SIGMA: f64 = 0.25;
/// Standard deviation of the part of the disparity noise that is correlated over the matching
/// window, at normal incidence, pixels of the image.
const CORRELATED_SIGMA: f64 = 0.5;
/// Disparity noise grows with this power of 1 / cos of the incidence: a slanted surface is matched
/// over a foreshortened window. Chosen so that raw points are as far from the surface as in the
/// benchmarks' table.
const INCIDENCE_EXPONENT: f64 = 1.5;
/// Distance at which the correlation of the correlated part is 1/e, pixels of the grid.
const CORRELATION_LENGTH: f64 = 6.0;
/// Step of the sub-pixel matching, pixels of the image.
const DISPARITY_STEP: f64 = 1.0 / 16.0;
/// Smaller disparities are not searched, pixels of the image.
const MIN_DISPARITY: f64 = 2.0;
/// Share of outliers among the points.
pub(super) const OUTLIER_RATIO: f64 = 0.01;
/// Outliers lie up to this distance nearer or farther than the object can, metres.
const OUTLIER_MARGIN: f64 = 0.05;
/// Least difference in depth between neighbours that makes an edge, metres. A slope of 75 degrees
/// stays below.
const MIN_EDGE_STEP: f64 = 8e-3;
/// Share of flying points among the pixels at an edge.
const FLYING_RATIO: f64 = 0.5;
/// How far a flying point lies behind the edge at most if there is nothing behind, metres: some
/// pixels of the grid.
const MAX_FLYING_TAIL: f64 = 20e-3;
/// Incidence from which points drop out, degrees.
const MIN_DROP_OUT_ANGLE: f64 = 50.0;
/// Incidence from which all points have dropped out, degrees. The probability is linear in between.
const FULL_DROP_OUT_ANGLE: f64 = 75.0;
/// Least distance from the pair to the centre of the object, in radii of the object.
const MIN_DISTANCE_RADII: f64 = 3.0;

/// The model of a pair that fits the object; it is farther away from a large one.
pub(crate) fn fit_model(scene: &SimulatedScene, params: &SimulateParams) -> StereoModel {
    StereoModel {
        working_distance: params.stereo_distance.max(MIN_DISTANCE_RADII * scene.radius()),
        range: [0.0, f64::INFINITY],
        ..MODEL
    }
}

/// Focal length, pixels of the image.
fn focal_length() -> f64 {
    MODEL.focal_length()
}

/// The ray of a pixel of the grid, scaled to z = 1, sensor frame.
fn ray(index: usize) -> Vec3 {
    MODEL.ray((index % GRID_SIZE[0]) as f64, (index / GRID_SIZE[0]) as f64)
}

/// One pair of images from `object_from_sensor`.
pub(crate) fn scan(
    scene: &SimulatedScene,
    model: &StereoModel,
    object_from_sensor: &Pose,
    source: RandomSource,
) -> SensorOutput {
    let hits: Vec<Option<Hit>> = (0..GRID_SIZE[0] * GRID_SIZE[1])
        .into_par_iter()
        .map(|index| cast_pixel_ray(scene, object_from_sensor, index))
        .collect();
    let matcher = StereoMatcher {
        hits: &hits,
        correlated: correlated_noise(source, GRID_SIZE[0], GRID_SIZE[1], CORRELATION_LENGTH),
        working_distance: model.working_distance,
        range: model.range,
        outlier_reach: scene.radius() + OUTLIER_MARGIN,
    };
    let rows: Vec<Vec<MeasuredPoint>> =
        (0..GRID_SIZE[1]).into_par_iter().map(|row| matcher.measure_row(row, source)).collect();
    let true_hits = hits
        .iter()
        .zip(rows.iter().flatten())
        .map(|(hit, measured)| match hit {
            Some(hit) if measured.point[0].is_finite() => single_precision(&hit.point),
            _ => NO_POINT,
        })
        .collect();
    SensorOutput::new(&rows, GRID_SIZE[0], Vec::new(), true_hits)
}

/// What both cameras see along the ray of a pixel of the grid.
fn cast_pixel_ray(scene: &SimulatedScene, object_from_sensor: &Pose, index: usize) -> Option<Hit> {
    let right_camera = Vec3::x() * BASELINE_M;
    let direction = ray(index).normalize();
    let hit = scene.cast_ray_seen_by_both(
        object_from_sensor,
        &Vec3::zeros(),
        &direction,
        &right_camera,
    )?;
    let right_column = focal_length() * (hit.point.x - BASELINE_M) / hit.point.z;
    // Outside the right image there is nothing to match.
    (right_column.abs() <= IMAGE_SIZE[0] / 2.0).then_some(Hit { depth: hit.point.z, ..hit })
}

/// The matching of one pair of images.
struct StereoMatcher<'a> {
    hits: &'a [Option<Hit>],
    /// Correlated noise of each pixel of the grid, of unit variance.
    correlated: Vec<f64>,
    working_distance: f64,
    /// Outliers lie within this distance of the working distance, metres.
    outlier_reach: f64,
    /// Nearest and farthest depth, metres.
    range: [f64; 2],
}

impl StereoMatcher<'_> {
    fn measure_row(&self, row: usize, source: RandomSource) -> Vec<MeasuredPoint> {
        let mut rng = source.rng(RandomUse::Sensor, row);
        (row * GRID_SIZE[0]..(row + 1) * GRID_SIZE[0])
            .map(|index| self.measure(index, &mut rng))
            .collect()
    }

    fn measure(&self, index: usize, rng: &mut ChaCha8Rng) -> MeasuredPoint {
        let Some(hit) = &self.hits[index] else { return MeasuredPoint::NO_RETURN };
        if rng.random_bool(drop_out_probability(hit.cosine)) {
            return MeasuredPoint::NO_RETURN;
        }
        let edge = find_depth_edge(self.hits, GRID_SIZE[0], index, MIN_EDGE_STEP);
        let (mut depth, mut label) = (hit.depth, hit.label());
        if rng.random_bool(OUTLIER_RATIO) {
            depth = self.working_distance + rng.random_range(-1.0..1.0) * self.outlier_reach;
            label = OUTLIER_LABEL;
        } else if edge != DepthEdge::None && rng.random_bool(FLYING_RATIO) {
            depth = draw_flying_depth(depth, edge, MAX_FLYING_TAIL, rng);
            label = FLYING_LABEL;
        }
        let noise = WHITE_SIGMA * standard_normal(rng) + CORRELATED_SIGMA * self.correlated[index];
        let disparity =
            focal_length() * BASELINE_M / depth + noise / hit.cosine.powf(INCIDENCE_EXPONENT);
        let disparity = (disparity / DISPARITY_STEP).round() * DISPARITY_STEP;
        let measured = focal_length() * BASELINE_M / disparity;
        if disparity < MIN_DISPARITY || !(self.range[0]..=self.range[1]).contains(&measured) {
            return MeasuredPoint::NO_RETURN;
        }
        MeasuredPoint { point: single_precision(&(ray(index) * measured)), label }
    }
}

/// Standard deviation of the depth, metres, at a depth (metres) and cosine of incidence.
pub(super) fn depth_sigma(depth: f64, cosine: f64) -> f64 {
    // Rounding to a step adds the variance of a uniform distribution.
    let rounding = DISPARITY_STEP * DISPARITY_STEP / 12.0;
    let matching = (WHITE_SIGMA * WHITE_SIGMA + CORRELATED_SIGMA * CORRELATED_SIGMA)
        / cosine.powf(2.0 * INCIDENCE_EXPONENT);
    depth * depth / (focal_length() * BASELINE_M) * (matching + rounding).sqrt()
}

/// Correlation of the depth errors of two different pixels this many columns and rows apart.
pub(super) fn depth_correlation(columns: f64, rows: f64) -> f64 {
    let share = CORRELATED_SIGMA * CORRELATED_SIGMA
        / (WHITE_SIGMA * WHITE_SIGMA + CORRELATED_SIGMA * CORRELATED_SIGMA);
    share * (-(columns * columns + rows * rows) / (CORRELATION_LENGTH * CORRELATION_LENGTH)).exp()
}

/// Probability that a point is lost, for the cosine of its incidence.
fn drop_out_probability(cosine: f64) -> f64 {
    let degrees = cosine.clamp(0.0, 1.0).acos().to_degrees();
    ((degrees - MIN_DROP_OUT_ANGLE) / (FULL_DROP_OUT_ANGLE - MIN_DROP_OUT_ANGLE)).clamp(0.0, 1.0)
}

#[cfg(test)]
#[path = "stereo_tests.rs"]
mod tests;
