//! Shapes whose edges are truly sharp, scanned by exact ray casting. Objects made of a lattice are
//! rounded at their edges, which hides what scans of machined parts do to a registration.

use crate::geometry::{Aabb, Pose, Scan, Twist, Vec3, exp, transform};
use crate::simulate::view_poses;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// A convex solid that rays can hit.
pub(super) enum Part {
    /// The points x with `n . x <= d` for all of these unit vectors n and distances d, metres.
    Convex(Vec<(Vec3, f64)>),
    /// A closed cylinder about z, metres.
    Cylinder { radius: f64, half_height: f64 },
    /// A ball about the origin with this radius, metres.
    Ball(f64),
}

/// The part of a ray inside a solid: distances from its start, metres.
#[derive(Clone, Copy)]
struct Span {
    near: f64,
    far: f64,
}

impl Span {
    const ALL: Span = Span { near: f64::NEG_INFINITY, far: f64::INFINITY };

    /// Where along a ray `slope t + height <= 0`.
    fn below(slope: f64, height: f64) -> Span {
        // A ray along a face is inside all the way or nowhere; -0 / 0 would decide by its sign.
        if slope == 0.0 {
            return if height > 0.0 {
                Span { far: f64::NEG_INFINITY, ..Span::ALL }
            } else {
                Span::ALL
            };
        }
        let at = -height / slope;
        if slope < 0.0 { Span { near: at, ..Span::ALL } } else { Span { far: at, ..Span::ALL } }
    }

    /// Where a ray is within `radius` of the origin.
    fn within_radius(from: &Vec3, along: &Vec3, radius: f64) -> Option<Span> {
        let square = along.norm_squared();
        let half = from.dot(along) / square;
        let inside = half * half - (from.norm_squared() - radius * radius) / square;
        (inside > 0.0).then(|| Span { near: -half - inside.sqrt(), far: -half + inside.sqrt() })
    }

    fn intersect(self, other: Span) -> Span {
        Span { near: self.near.max(other.near), far: self.far.min(other.far) }
    }
}

impl Part {
    /// Distance along the unit vector `along` from `from`, which lies outside, to where the ray
    /// enters.
    fn cast_ray(&self, from: &Vec3, along: &Vec3) -> Option<f64> {
        let span = match self {
            Part::Convex(faces) => faces
                .iter()
                .map(|(n, d)| Span::below(n.dot(along), n.dot(from) - d))
                .fold(Span::ALL, Span::intersect),
            Part::Cylinder { radius, half_height } => {
                let [flat_from, flat_along] = [from, along].map(|v| Vec3::new(v.x, v.y, 0.0));
                let round = Span::within_radius(&flat_from, &flat_along, *radius)?;
                let [top, bottom] = [1.0, -1.0]
                    .map(|side| Span::below(side * along.z, side * from.z - half_height));
                round.intersect(top).intersect(bottom)
            }
            Part::Ball(radius) => Span::within_radius(from, along, *radius)?,
        };
        (span.near < span.far && span.near > 0.0).then_some(span.near)
    }
}

/// A block with these corners, millimetres.
fn block(low: [f64; 3], high: [f64; 3]) -> Part {
    let faces = (0..3).flat_map(|k| {
        let axis = Vec3::from_fn(|i, _| f64::from(i == k));
        [(axis, high[k] * 1e-3), (-axis, -low[k] * 1e-3)]
    });
    Part::Convex(faces.collect())
}

/// A prism about z of a regular polygon with this radius of the inner circle and half of its
/// height, millimetres.
fn prism(sides: u32, radius: f64, half_height: f64) -> Part {
    let around = (0..sides).map(|k| {
        let angle = std::f64::consts::TAU * f64::from(k) / f64::from(sides);
        (Vec3::new(angle.cos(), angle.sin(), 0.0), radius * 1e-3)
    });
    let ends = [1.0, -1.0].map(|side| (Vec3::z() * side, half_height * 1e-3));
    Part::Convex(around.chain(ends).collect())
}

/// The shape with this name: box, l, wedge, prism, ribs, cylinder or sphere.
pub(super) fn shape(name: &str) -> Vec<Part> {
    match name {
        "box" => vec![block([-40.0, -25.0, -20.0], [40.0, 25.0, 20.0])],
        "l" => vec![
            block([-40.0, -25.0, -20.0], [40.0, 25.0, 0.0]),
            block([-40.0, -25.0, 0.0], [-10.0, 25.0, 20.0]),
        ],
        "wedge" => {
            let Part::Convex(mut faces) = block([-40.0, -25.0, -20.0], [40.0, 25.0, 20.0]) else {
                return Vec::new();
            };
            let slope = Vec3::new(40.0, 0.0, 80.0).normalize();
            faces.push((slope, 0.0));
            vec![Part::Convex(faces)]
        }
        "prism" => vec![prism(8, 30.0, 25.0)],
        "ribs" => {
            let base = block([-40.0, -25.0, -20.0], [40.0, 25.0, 12.0]);
            let ribs = (0..10).map(|k| {
                let x = -40.0 + 8.0 * f64::from(k) + 2.0;
                block([x, -25.0, 12.0], [x + 4.0, 25.0, 16.0])
            });
            std::iter::once(base).chain(ribs).collect()
        }
        "cylinder" => vec![Part::Cylinder { radius: 0.03, half_height: 0.03 }],
        _ => vec![Part::Ball(0.03)],
    }
}

/// Distance of the sensor from the origin, metres.
pub(super) const SENSOR_DISTANCE: f64 = 0.35;

/// Poses `object_from_sensor` of `count` views of the origin, spread evenly.
pub(super) fn even_views(count: usize) -> Vec<Pose> {
    view_poses(&Aabb { min: Vec3::zeros(), max: Vec3::zeros() }, SENSOR_DISTANCE, count)
}

/// The scan that a camera at `pose` (`object_from_sensor`) takes of a shape: points `spacing`
/// (metres) apart at the shape's middle, with noise of standard deviation `noise` (metres) along
/// the rays.
pub(super) fn simulate_scan(
    shape: &[Part],
    pose: &Pose,
    spacing: f64,
    noise: f64,
    rng: &mut ChaCha8Rng,
) -> Scan {
    let [columns, rows] = [0.128, 0.102].map(|size: f64| (size / spacing).round() as usize);
    let mut points = Vec::new();
    for i in 0..columns * rows {
        let [x, y] = [(i % columns, columns), (i / columns, rows)]
            .map(|(k, count)| (k as f64 - (count as f64 - 1.0) / 2.0) * spacing / SENSOR_DISTANCE);
        let ray = Vec3::new(x, y, 1.0).normalize();
        let (from, along) = (pose.translation.vector, pose.rotation * ray);
        let hit =
            shape.iter().filter_map(|part| part.cast_ray(&from, &along)).min_by(f64::total_cmp);
        let deviate: f64 = rng.sample(StandardNormal);
        let point = hit.map_or([f64::NAN; 3], |t| (ray * (t + noise * deviate)).into());
        points.push(point.map(|v| v as f32));
    }
    Scan { points, width: columns, origins: Vec::new() }
}

/// `poses`, each with an error of standard deviation `translation` (metres) and `rotation`
/// (radians) an axis.
pub(super) fn perturbed(poses: &[Pose], translation: f64, rotation: f64, seed: u64) -> Vec<Pose> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    poses
        .iter()
        .map(|pose| {
            let error = Twist::from_fn(|i, _| {
                let deviate: f64 = rng.sample(StandardNormal);
                deviate * if i < 3 { translation } else { rotation }
            });
            pose * exp(&error)
        })
        .collect()
}

/// How far the scans' points are from where they belong, metres.
pub(super) struct Displacement {
    /// Mean along the views' axes; negative towards the sensors.
    pub along_views: f64,
    /// Root mean square.
    pub rms: f64,
}

impl Displacement {
    pub(super) fn new(scans: &[Scan], truth: &[Pose], found: &[Pose]) -> Displacement {
        let (mut along, mut square, mut count) = (0.0, 0.0, 0.0);
        for ((scan, truth), found) in scans.iter().zip(truth).zip(found) {
            let axis = truth.rotation * Vec3::z();
            for point in scan.returns().filter_map(|i| scan.point(i)) {
                let error = transform(found, &point) - transform(truth, &point);
                along += error.dot(&axis);
                square += error.norm_squared();
                count += 1.0;
            }
        }
        Displacement { along_views: along / count, rms: (square / count).sqrt() }
    }
}

#[test]
fn a_shift_of_all_scans_is_found_in_full() {
    let truth = even_views(3);
    let scans: Vec<Scan> = (1..=3)
        .zip(&truth)
        .map(|(seed, pose)| {
            simulate_scan(&shape("box"), pose, 3.2e-3, 0.0, &mut ChaCha8Rng::seed_from_u64(seed))
        })
        .collect();
    let moved: Vec<Pose> =
        truth.iter().map(|pose| pose * exp(&Twist::new(0.0, 0.0, -1e-3, 0.0, 0.0, 0.0))).collect();
    let found = Displacement::new(&scans, &truth, &moved);
    assert!((found.along_views + 1e-3).abs() < 1e-9, "{}", found.along_views);
    assert!((found.rms - 1e-3).abs() < 1e-9, "{}", found.rms);
}

#[test]
fn rays_hit_the_faces_that_they_see() {
    let from = Vec3::new(0.2, 0.01, 0.005);
    for (name, expected) in [("box", 0.16), ("cylinder", 0.2 - 8e-4_f64.sqrt())] {
        let hits = shape(name);
        let hit = hits.iter().filter_map(|part| part.cast_ray(&from, &-Vec3::x()));
        let nearest = hit.min_by(f64::total_cmp).unwrap();
        assert!((nearest - expected).abs() < 1e-12, "{name}: {nearest}");
        let beside = Vec3::new(0.2, 0.04, 0.0);
        assert!(hits.iter().all(|part| part.cast_ray(&beside, &-Vec3::x()).is_none()), "{name}");
    }
}
