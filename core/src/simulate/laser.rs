//! Laser striper, swept by the arm: scanCONTROL 2700-100 on a KR 16-2.
//!
//! The laser's fan lies in the xz plane of the sensor frame, and the arm carries it along y. The camera stands
//! beside the laser along y, so that what it cannot see is a triangulation shadow.

use super::labels::{FLYING, GOOD, OUTLIER};
use super::noise::{Dice, Edge, Use, edge, flying_depth, normal};
use super::scene::{Hit, Scene};
use super::{SimulateParams, f32s};
use crate::geometry::{Pose, Scan, StriperModel, Vec3};
use rand::RngExt;
use rayon::prelude::*;

/// Points of a profile.
const POINTS: usize = StriperModel::SCANCONTROL.points;
/// Standard deviation along the ray, metres, head on and at its largest; between them it grows with the
/// length of the spot on the surface, 1 / cos of the incidence.
const SIGMA: [f64; 2] = [0.05e-3, 0.2e-3];
/// Share of outliers.
pub(super) const OUTLIERS: f64 = 0.0005;
/// Standard deviation per axis of the arm's wander from one profile to the next, metres.
pub(super) const JITTER: f64 = 0.007e-3;
/// Depth difference between neighbours that makes an edge, metres; a slope of 80 degrees stays below.
const EDGE: f64 = 3e-3;
/// Share of edge points where the spot is split between both sides.
const FLYING_SHARE: f64 = 0.3;
/// How far a flying point lies behind the edge if there is nothing behind, metres: some widths of the spot.
const TAIL: f64 = 2e-3;
/// Empty run before and behind the object, metres.
const RUN: f64 = 5e-3;

/// The striper before an object.
pub(crate) struct Striper {
    model: StriperModel,
    /// Half the diagonal of the object's box, metres: outliers lie within.
    radius: f64,
}

/// Chooses the number of profiles; an object wider than the fan is scanned from farther off, with all spacings
/// grown alike.
pub(crate) fn model_for(scene: &Scene, params: &SimulateParams) -> StriperModel {
    let sweep = 2.0 * (scene.radius() + RUN);
    let scale = (sweep / (POINTS as f64 * params.point_spacing)).max(1.0);
    let profile_spacing = params.profile_spacing * scale;
    StriperModel {
        working_distance: (params.laser_distance * scale).max(scene.radius() * 1.5),
        point_spacing: params.point_spacing * scale,
        profile_spacing,
        profiles: (sweep / profile_spacing).ceil() as usize + 1,
        range: [0.0, f64::INFINITY],
        ..StriperModel::SCANCONTROL
    }
}

impl Striper {
    pub(crate) fn new(model: StriperModel, scene: &Scene) -> Striper {
        Striper { model, radius: scene.radius() }
    }

    /// The origin of each profile as the arm reports it, sensor frame.
    fn origin(&self, row: usize) -> Vec3 {
        self.model.origin(row as f64)
    }

    /// Unit direction of the ray of a column.
    fn ray(&self, column: usize) -> Vec3 {
        self.model.ray(column as f64)
    }

    /// How far the arm is off at each profile: a random walk, zero at the middle, where the pose was taken.
    fn wander(&self, dice: Dice) -> Vec<Vec3> {
        let mut rng = dice.rng(Use::Sweep, 0);
        let mut at = Vec3::zeros();
        let walk: Vec<Vec3> = (0..self.model.profiles)
            .map(|_| {
                at += Vec3::from_fn(|_, _| normal(&mut rng)) * JITTER;
                at
            })
            .collect();
        let middle = walk[self.model.profiles / 2];
        walk.into_iter().map(|offset| offset - middle).collect()
    }

    /// One sweep from `object_from_sensor`: the scan, labels and noise-free hits.
    pub(crate) fn scan(
        &self,
        scene: &Scene,
        object_from_sensor: &Pose,
        dice: Dice,
    ) -> (Scan, Vec<u8>, Vec<[f32; 3]>) {
        let wander = self.wander(dice);
        let cast = |index: usize| {
            let laser = self.origin(index / POINTS) + wander[index / POINTS];
            let camera = laser - Vec3::y() * self.model.camera_offset;
            scene.hit(object_from_sensor, &laser, &self.ray(index % POINTS), &camera)
        };
        let count = self.model.profiles * POINTS;
        let hits: Vec<Option<Hit>> = (0..count).into_par_iter().map(cast).collect();
        let rows: Vec<Vec<([f32; 3], u8)>> = (0..self.model.profiles)
            .into_par_iter()
            .map(|row| self.profile(&hits, row, dice))
            .collect();
        let (points, labels) = rows.concat().into_iter().unzip();
        let origins = (0..count).map(|i| f32s(&self.origin(i / POINTS))).collect();
        let hits = hits.iter().map(|hit| hit.map_or([f32::NAN; 3], |h| f32s(&h.point))).collect();
        (Scan { points, width: POINTS, origins }, labels, hits)
    }

    /// What the sensor makes of one row of hits.
    fn profile(&self, hits: &[Option<Hit>], row: usize, dice: Dice) -> Vec<([f32; 3], u8)> {
        let mut rng = dice.rng(Use::Sensor, row);
        let mut measure = |column: usize| {
            let index = row * POINTS + column;
            let none = ([f32::NAN; 3], GOOD);
            let Some(hit) = &hits[index] else { return none };
            let edge = edge(hits, POINTS, index, EDGE);
            let (mut depth, mut label) = (hit.depth, hit.label());
            if rng.random_bool(OUTLIERS) {
                depth = self.model.working_distance + rng.random_range(-1.0..1.0) * self.radius;
                label = OUTLIER;
            } else if edge != Edge::None && rng.random_bool(FLYING_SHARE) {
                depth = flying_depth(depth, edge, TAIL, &mut rng);
                label = FLYING;
            }
            depth += normal(&mut rng) * sigma(hit.cosine);
            if !(self.model.range[0]..=self.model.range[1]).contains(&depth) {
                return none;
            }
            (f32s(&(self.origin(row) + self.ray(column) * depth)), label)
        };
        (0..POINTS).map(&mut measure).collect()
    }
}

/// Standard deviation along the ray, metres.
pub(super) fn sigma(cosine: f64) -> f64 {
    (SIGMA[0] / cosine).min(SIGMA[1])
}

#[cfg(test)]
#[path = "laser_tests.rs"]
mod tests;
