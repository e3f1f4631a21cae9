//! Laser striper swept by the arm: scanCONTROL 2700-100 on a KR 16-2.
//!
//! The laser's fan lies in the xz plane of the sensor frame, and the arm carries it along y. The
//! camera is beside the laser along y, so that what it cannot see is a triangulation shadow.

use super::depth_edge::{DepthEdge, draw_flying_depth, find_depth_edge};
use super::labels::{FLYING_LABEL, OUTLIER_LABEL};
use super::params::SimulateParams;
use super::random::{RandomSource, RandomUse, standard_normal};
use super::scene::{Hit, SimulatedScene};
use super::sensor_output::{MeasuredPoint, NO_POINT, SensorOutput, single_precision};
use crate::geometry::{Pose, StriperModel, Vec3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Number of points of a profile.
const PROFILE_POINTS: usize = StriperModel::SCANCONTROL.points;
/// Standard deviation along the ray at normal incidence, metres. It grows with the length of the
/// spot on the surface, 1 / cos of the incidence.
const NORMAL_INCIDENCE_SIGMA: f64 = 0.05e-3;
/// Largest standard deviation along the ray, metres.
const MAX_SIGMA: f64 = 0.2e-3;
/// Share of outliers among the points.
pub(super) const OUTLIER_RATIO: f64 = 0.0005;
/// Standard deviation per axis of the arm's random walk from one profile to the next, metres.
pub(super) const WALK_STEP_SIGMA: f64 = 0.007e-3;
/// Least difference in depth between neighbours that makes an edge, metres. A slope of 80 degrees
/// stays below.
const MIN_EDGE_STEP: f64 = 3e-3;
/// Share of flying points, where the spot is split between both sides, among the points at an edge.
const FLYING_RATIO: f64 = 0.3;
/// How far a flying point lies behind the edge at most if there is nothing behind, metres: some
/// widths of the spot.
const MAX_FLYING_TAIL: f64 = 2e-3;
/// Length of the sweep before and behind the object, metres.
const SWEEP_OVERRUN: f64 = 5e-3;
/// Least distance from the laser to the centre of the object, in radii of the object.
const MIN_DISTANCE_RADII: f64 = 1.5;

/// The striper in front of an object.
pub(crate) struct Striper {
    model: StriperModel,
    /// Half the diagonal of the object's box, metres. Outliers lie within this distance of the
    /// working distance.
    radius: f64,
}

/// The model of a striper that fits the object. An object wider than the fan is scanned from
/// farther away, with all spacings enlarged by the same factor.
pub(crate) fn fit_model(scene: &SimulatedScene, params: &SimulateParams) -> StriperModel {
    let sweep = 2.0 * (scene.radius() + SWEEP_OVERRUN);
    let scale = (sweep / (PROFILE_POINTS as f64 * params.point_spacing)).max(1.0);
    let profile_spacing = params.profile_spacing * scale;
    StriperModel {
        working_distance: (params.laser_distance * scale).max(scene.radius() * MIN_DISTANCE_RADII),
        point_spacing: params.point_spacing * scale,
        profile_spacing,
        profiles: (sweep / profile_spacing).ceil() as usize + 1,
        range: [0.0, f64::INFINITY],
        ..StriperModel::SCANCONTROL
    }
}

impl Striper {
    pub(crate) fn new(model: StriperModel, scene: &SimulatedScene) -> Striper {
        Striper { model, radius: scene.radius() }
    }

    /// The origin of a profile as the arm reports it, sensor frame, metres.
    fn origin(&self, row: usize) -> Vec3 {
        self.model.origin(row as f64)
    }

    /// Unit direction of the ray of a column, sensor frame.
    fn ray(&self, column: usize) -> Vec3 {
        self.model.ray(column as f64)
    }

    /// The error of the arm's position at each profile, metres: a random walk that is zero in the
    /// middle, where the pose was taken.
    fn draw_random_walk(&self, source: RandomSource) -> Vec<Vec3> {
        let mut rng = source.rng(RandomUse::Sweep, 0);
        let mut offset = Vec3::zeros();
        let walk: Vec<Vec3> = (0..self.model.profiles)
            .map(|_| {
                offset += Vec3::from_fn(|_, _| standard_normal(&mut rng)) * WALK_STEP_SIGMA;
                offset
            })
            .collect();
        let middle = walk[self.model.profiles / 2];
        walk.into_iter().map(|offset| offset - middle).collect()
    }

    /// One sweep from `object_from_sensor`.
    pub(crate) fn scan(
        &self,
        scene: &SimulatedScene,
        object_from_sensor: &Pose,
        source: RandomSource,
    ) -> SensorOutput {
        let walk = self.draw_random_walk(source);
        let count = self.model.profiles * PROFILE_POINTS;
        let hits: Vec<Option<Hit>> = (0..count)
            .into_par_iter()
            .map(|index| {
                let laser = self.origin(index / PROFILE_POINTS) + walk[index / PROFILE_POINTS];
                let camera = laser - Vec3::y() * self.model.camera_offset;
                let ray = self.ray(index % PROFILE_POINTS);
                scene.cast_ray_seen_by_both(object_from_sensor, &laser, &ray, &camera)
            })
            .collect();
        let rows: Vec<Vec<MeasuredPoint>> = (0..self.model.profiles)
            .into_par_iter()
            .map(|row| self.measure_profile(&hits, row, source))
            .collect();
        let origins =
            (0..count).map(|i| single_precision(&self.origin(i / PROFILE_POINTS))).collect();
        let hits = hits
            .iter()
            .map(|hit| hit.map_or(NO_POINT, |hit| single_precision(&hit.point)))
            .collect();
        SensorOutput::new(&rows, PROFILE_POINTS, origins, hits)
    }

    /// What the sensor measures of one row of hits.
    fn measure_profile(
        &self,
        hits: &[Option<Hit>],
        row: usize,
        source: RandomSource,
    ) -> Vec<MeasuredPoint> {
        let mut rng = source.rng(RandomUse::Sensor, row);
        (0..PROFILE_POINTS)
            .map(|column| self.measure(hits, row * PROFILE_POINTS + column, &mut rng))
            .collect()
    }

    fn measure(&self, hits: &[Option<Hit>], index: usize, rng: &mut ChaCha8Rng) -> MeasuredPoint {
        let Some(hit) = &hits[index] else { return MeasuredPoint::NO_RETURN };
        let edge = find_depth_edge(hits, PROFILE_POINTS, index, MIN_EDGE_STEP);
        let (mut depth, mut label) = (hit.depth, hit.label());
        if rng.random_bool(OUTLIER_RATIO) {
            depth = self.model.working_distance + rng.random_range(-1.0..1.0) * self.radius;
            label = OUTLIER_LABEL;
        } else if edge != DepthEdge::None && rng.random_bool(FLYING_RATIO) {
            depth = draw_flying_depth(depth, edge, MAX_FLYING_TAIL, rng);
            label = FLYING_LABEL;
        }
        depth += standard_normal(rng) * range_sigma(hit.cosine);
        if !(self.model.range[0]..=self.model.range[1]).contains(&depth) {
            return MeasuredPoint::NO_RETURN;
        }
        let (row, column) = (index / PROFILE_POINTS, index % PROFILE_POINTS);
        let point = single_precision(&(self.origin(row) + self.ray(column) * depth));
        MeasuredPoint { point, label }
    }
}

/// Standard deviation along the ray, metres, for the cosine of the angle of incidence.
pub(super) fn range_sigma(cosine: f64) -> f64 {
    (NORMAL_INCIDENCE_SIGMA / cosine).min(MAX_SIGMA)
}

#[cfg(test)]
#[path = "laser_tests.rs"]
mod tests;
