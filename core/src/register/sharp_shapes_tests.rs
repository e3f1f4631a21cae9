//! Shapes whose edges are truly sharp, scanned by exact ray casting. Objects made of a lattice are
//! rounded at their edges, which hides what scans of machined parts do to a registration.

use crate::geometry::{Aabb, Pose, Scan, Twist, Vec3, exp};
use crate::simulate::view_poses;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// What a ray can meet.
pub(super) enum Part {
    /// The points x with `n . x <= d` for all of these unit vectors n and distances d, metres.
    Convex(Vec<(Vec3, f64)>),
    /// A closed cylinder about z: radius and half of its height, metres.
    Cylinder(f64, f64),
    /// A ball about the origin: radius, metres.
    Ball(f64),
}

impl Part {
    /// Distance along the unit vector `along` from `from`, which lies outside, to where the ray
    /// enters.
    fn met(&self, from: &Vec3, along: &Vec3) -> Option<f64> {
        let (near, far) = match self {
            Part::Convex(faces) => {
                let spans = faces.iter().map(|(n, d)| between(n.dot(along), n.dot(from) - d));
                spans.fold((f64::NEG_INFINITY, f64::INFINITY), common)
            }
            Part::Cylinder(radius, half) => {
                let flat = |v: &Vec3| Vec3::new(v.x, v.y, 0.0);
                let round = within(&flat(from), &flat(along), *radius)?;
                let [top, bottom] =
                    [1.0, -1.0].map(|side| between(side * along.z, side * from.z - half));
                common(common(round, top), bottom)
            }
            Part::Ball(radius) => within(from, along, *radius)?,
        };
        (near < far && near > 0.0).then_some(near)
    }
}

/// Where along a ray `slope t + height <= 0`.
fn between(slope: f64, height: f64) -> (f64, f64) {
    let at = -height / slope;
    if slope < 0.0 { (at, f64::INFINITY) } else { (f64::NEG_INFINITY, at) }
}

fn common(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0.max(b.0), a.1.min(b.1))
}

/// Where along a ray it is within `radius` of the origin.
fn within(from: &Vec3, along: &Vec3, radius: f64) -> Option<(f64, f64)> {
    let square = along.norm_squared();
    let half = from.dot(along) / square;
    let inside = half * half - (from.norm_squared() - radius * radius) / square;
    (inside > 0.0).then(|| (-half - inside.sqrt(), -half + inside.sqrt()))
}

/// A block with these corners, millimetres.
fn block(low: [f64; 3], high: [f64; 3]) -> Part {
    let face = |k: usize| {
        let axis = Vec3::from_fn(|i, _| f64::from(i == k));
        [(axis, high[k] * 1e-3), (-axis, -low[k] * 1e-3)]
    };
    Part::Convex((0..3).flat_map(face).collect())
}

/// A prism about z of a regular polygon with this radius of the inner circle and half of its
/// height, millimetres.
fn prism(sides: u32, radius: f64, half: f64) -> Part {
    let around = (0..sides).map(|k| {
        let angle = std::f64::consts::TAU * f64::from(k) / f64::from(sides);
        (Vec3::new(angle.cos(), angle.sin(), 0.0), radius * 1e-3)
    });
    let ends = [1.0, -1.0].map(|side| (Vec3::z() * side, half * 1e-3));
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
            let rib = |k: u32| {
                let x = -40.0 + 8.0 * f64::from(k) + 2.0;
                block([x, -25.0, 12.0], [x + 4.0, 25.0, 16.0])
            };
            std::iter::once(base).chain((0..10).map(rib)).collect()
        }
        "cylinder" => vec![Part::Cylinder(0.03, 0.03)],
        _ => vec![Part::Ball(0.03)],
    }
}

/// Distance of the sensor, metres.
pub(super) const AWAY: f64 = 0.35;

/// Poses `object_from_sensor` of `count` views of the origin, spread evenly.
pub(super) fn views(count: usize) -> Vec<Pose> {
    view_poses(&Aabb { min: Vec3::zeros(), max: Vec3::zeros() }, AWAY, count)
}

/// What a camera at `pose` (`object_from_sensor`) sees of a shape: points `spacing` (metres) apart
/// at its middle, with noise of standard deviation `noise` (metres) along the rays.
pub(super) fn look(
    shape: &[Part],
    pose: &Pose,
    spacing: f64,
    noise: f64,
    rng: &mut ChaCha8Rng,
) -> Scan {
    let [columns, rows] = [0.128, 0.102].map(|size: f64| (size / spacing).round() as usize);
    let at = |i: usize, count: usize| (i as f64 - (count as f64 - 1.0) / 2.0) * spacing / AWAY;
    let mut points = Vec::new();
    for i in 0..columns * rows {
        let ray = Vec3::new(at(i % columns, columns), at(i / columns, rows), 1.0).normalize();
        let (from, along) = (pose.translation.vector, pose.rotation * ray);
        let met = shape.iter().filter_map(|part| part.met(&from, &along)).min_by(f64::total_cmp);
        let deviate: f64 = rng.sample(StandardNormal);
        let point = met.map_or([f64::NAN; 3], |t| (ray * (t + noise * deviate)).into());
        points.push(point.map(|v| v as f32));
    }
    Scan { points, width: columns, origins: Vec::new() }
}

/// `poses`, each off by a deviation of `shift` (metres) and `turn` (radians) an axis.
pub(super) fn jittered(poses: &[Pose], shift: f64, turn: f64, seed: u64) -> Vec<Pose> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut off = || {
        let deviate = Twist::from_fn(|i, _| {
            let d: f64 = rng.sample(StandardNormal);
            d * if i < 3 { shift } else { turn }
        });
        exp(&deviate)
    };
    poses.iter().map(|pose| pose * off()).collect()
}

/// How far the scans' points are from where they belong, metres: along the views' axes in the mean
/// (towards the sensors: negative), and their root mean square.
pub(super) fn displaced(scans: &[Scan], truth: &[Pose], found: &[Pose]) -> (f64, f64) {
    let (mut along, mut square, mut count) = (0.0, 0.0, 0.0);
    for ((scan, truth), found) in scans.iter().zip(truth).zip(found) {
        let axis = truth.rotation * Vec3::z();
        for i in scan.returns() {
            let Some(point) = scan.point(i) else { continue };
            let off =
                (found * nalgebra::Point3::from(point)) - (truth * nalgebra::Point3::from(point));
            along += off.dot(&axis);
            square += off.norm_squared();
            count += 1.0;
        }
    }
    (along / count, (square / count).sqrt())
}
