//! Shapes that leave directions of motion free: the verdict names these directions, along them the
//! pose stays where the prior is, and the covariance states how far off the pose may be.

use super::*;
use crate::geometry::{Mat6, Scan, Twist, Vec3, exp, log};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Distance from the sensor to the shape's middle, metres.
const SENSOR_DISTANCE: f64 = 0.5;
/// Rays in a row and in a column of the image.
const IMAGE_SIDE: usize = 130;
/// Distance between rays at the shape, metres.
const RAY_SPACING: f64 = 1e-3;
/// Standard deviation of the guess an axis, about the shape's middle, metres.
const TRANSLATION_SIGMA: f64 = 2e-3;
/// The same in radians.
const ROTATION_SIGMA: f64 = 0.02;
/// Number of draws.
const SEED_COUNT: u64 = 12;
/// Rays in a row and in a column of a patch that shares its noise.
const PATCH_SIDE: usize = 6;

/// A shape about the origin: how far along a ray (start, unit direction) its surface is.
type Shape = fn(&Vec3, &Vec3) -> Option<f64>;

fn ball(from: &Vec3, along: &Vec3) -> Option<f64> {
    let half = from.dot(along);
    let inside = half * half - from.norm_squared() + 0.045 * 0.045;
    (inside > 0.0).then(|| -half - inside.sqrt())
}

/// Endless along x.
fn cylinder(from: &Vec3, along: &Vec3) -> Option<f64> {
    let [o, d] = [from, along].map(|v| Vec3::new(0.0, v.y, v.z));
    let half = o.dot(&d) / d.norm_squared();
    let inside = half * half - (o.norm_squared() - 0.04 * 0.04) / d.norm_squared();
    (inside > 0.0).then(|| -half - inside.sqrt())
}

/// The plane z = 0, without end; a box seen from one side is the same.
fn plane(from: &Vec3, along: &Vec3) -> Option<f64> {
    Some(-from.z / along.z)
}

/// Where the noise of a sensor comes from.
#[derive(Clone, Copy)]
enum Noise {
    /// White, standard deviation 0.1 mm.
    Laser,
    /// Patches of 6 x 6 rays share most of it: 1 mm.
    Stereo,
}

impl Noise {
    /// The errors of all rays, metres.
    fn draw(self, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let fine = white_noise(rng);
        let Noise::Stereo = self else {
            return (0..IMAGE_SIDE * IMAGE_SIDE).map(|i| fine[i] * 1e-4).collect();
        };
        let coarse = white_noise(rng);
        (0..IMAGE_SIDE * IMAGE_SIDE)
            .map(|i| 0.9e-3 * patch_sum(&coarse, i) / 6.0 + 0.4e-3 * fine[i])
            .collect()
    }
}

/// White noise of unit variance, of an image with a margin as wide as a patch.
fn white_noise(rng: &mut ChaCha8Rng) -> Vec<f64> {
    let side = IMAGE_SIDE + PATCH_SIDE;
    (0..side * side).map(|_| rng.sample(StandardNormal)).collect()
}

/// The sum of `noise` over the patch at ray `i`.
fn patch_sum(noise: &[f64], i: usize) -> f64 {
    let (row, column) = (i / IMAGE_SIDE, i % IMAGE_SIDE);
    (0..PATCH_SIDE * PATCH_SIDE)
        .map(|k| {
            let (row, column) = (row + k / PATCH_SIDE, column + k % PATCH_SIDE);
            noise[row * (IMAGE_SIDE + PATCH_SIDE) + column]
        })
        .sum()
}

/// The scan that a camera at `pose` (`object_from_sensor`) takes of `shape`.
fn simulate_scan(shape: Shape, noise: Noise, pose: &Pose, rng: &mut ChaCha8Rng) -> PreparedScan {
    let mut points = Vec::new();
    for (i, noise) in noise.draw(rng).iter().enumerate() {
        let [x, y] = [i % IMAGE_SIDE, i / IMAGE_SIDE]
            .map(|k| (k as f64 - IMAGE_SIDE as f64 / 2.0) * RAY_SPACING);
        let ray = Vec3::new(x, y, SENSOR_DISTANCE).normalize();
        let Some(depth) = shape(&pose.translation.vector, &(pose.rotation * ray)) else { continue };
        let point = ray * (depth + noise);
        points.push([point.x as f32, point.y as f32, point.z as f32]);
    }
    PreparedScan::new(&Scan { points, ..Scan::default() }).unwrap()
}

/// `object_from_sensor` of a sensor that looks at the shape's middle, `tilt` radians from straight
/// above.
fn tilted_view(tilt: f64) -> Pose {
    let at = Vec3::new(
        SENSOR_DISTANCE * 0.3 * tilt,
        SENSOR_DISTANCE * tilt.sin(),
        SENSOR_DISTANCE * tilt.cos(),
    )
    .into();
    Pose::face_towards(&at, &nalgebra::Point3::origin(), &Vec3::x())
}

/// Uncertainty of the pose of a single scan.
const SIGMA: PoseSigma = PoseSigma { translation: TRANSLATION_SIGMA, rotation: ROTATION_SIGMA };

/// Covariance of a turn about the point (0, 0, SENSOR_DISTANCE) of the sensor frame and a shift.
fn about_the_middle() -> Mat6 {
    let of_middle = Mat6::from_fn(|r, c| {
        if r != c {
            0.0
        } else if r < 3 {
            TRANSLATION_SIGMA * TRANSLATION_SIGMA
        } else {
            ROTATION_SIGMA * ROTATION_SIGMA
        }
    });
    let to_sensor = crate::geometry::adjoint(&Pose::translation(0.0, 0.0, SENSOR_DISTANCE));
    to_sensor * of_middle * to_sensor.transpose()
}

struct Outcome {
    /// xi in T_estimate = T_true exp(xi), before and after.
    before: Twist,
    after: Twist,
    verdict: Verdict,
    /// Motions of the fixed frame (the object's) as twists of the moving one.
    moving_from_object: Mat6,
}

fn outcomes(shape: Shape, noise: Noise) -> Vec<Outcome> {
    (1..=SEED_COUNT).map(|seed| outcome(shape, noise, seed)).collect()
}

fn outcome(shape: Shape, noise: Noise, seed: u64) -> Outcome {
    let params = RegisterParams::default();
    let covariance = about_the_middle();
    let root = covariance.cholesky().unwrap().l();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (there, here) = (tilted_view(-0.15), tilted_view(0.15));
    let fixed = PairScan::new(&simulate_scan(shape, noise, &there, &mut rng), SIGMA, &params);
    let moving = PairScan::new(&simulate_scan(shape, noise, &here, &mut rng), SIGMA, &params);
    let truth = there.inverse() * here;
    let error: Twist = root * Twist::from_fn(|_, _| rng.sample(StandardNormal));
    let guess = truth * exp(&error);
    let (pose, verdict) =
        align_pair_with_covariance(&moving, &fixed, &guess, &covariance, &params).unwrap();
    Outcome {
        before: error,
        after: log(&(truth.inverse() * pose)),
        verdict,
        moving_from_object: crate::geometry::adjoint(&here.inverse()),
    }
}

/// The normalised estimation error squared of the six parameters, its mean over the seeds: 6
/// expected. Larger than 12 would say that standard deviations are stated too small by more than a
/// factor of 1.4.
fn mean_nees(outcomes: &[Outcome]) -> f64 {
    let sum: f64 = outcomes
        .iter()
        .map(|o| o.after.dot(&(o.verdict.covariance.try_inverse().unwrap() * o.after)))
        .sum();
    sum / outcomes.len() as f64
}

/// The part of the unit twist `motion` (object frame) that lies in the span of the free directions,
/// in units of the prior: 1 for a free one.
fn freedom(outcome: &Outcome, motion: &Twist) -> f64 {
    let whiten = about_the_middle().cholesky().unwrap().l().try_inverse().unwrap();
    let unit = (whiten * outcome.moving_from_object * motion).normalize();
    let mut left = unit;
    let mut basis: Vec<Twist> = Vec::new();
    for direction in &outcome.verdict.free_directions {
        let mut v: Twist = whiten * direction;
        for b in &basis {
            v -= b * b.dot(&v);
        }
        if let Some(v) = v.try_normalize(1e-9) {
            left -= v * v.dot(&left);
            basis.push(v);
        }
    }
    (1.0 - left.norm_squared()).max(0.0).sqrt()
}

fn check_directions(shape: Shape, noise: Noise, free: &[Twist], determined: &[Twist]) {
    let outcomes = outcomes(shape, noise);
    let nees = mean_nees(&outcomes);
    assert!(nees < 12.0, "nees {nees}");
    for (seed, o) in outcomes.iter().enumerate() {
        assert!(o.verdict.is_accepted(), "{seed}: {}", o.verdict.reason);
        assert!(o.verdict.free_directions.len() >= free.len(), "{seed}: {}", o.verdict.reason);
        assert!(o.verdict.reason.contains("left to the robot"), "{}", o.verdict.reason);
        for motion in free {
            let share = freedom(o, motion);
            assert!(share > 0.95, "seed {seed}: {motion} is free to {share}");
        }
        for motion in determined {
            let share = freedom(o, motion);
            assert!(share < 0.5, "seed {seed}: {motion} is free to {share}");
        }
        // Along free directions the prior's own error remains; the geometry adds none.
        let whiten = about_the_middle().cholesky().unwrap().l().try_inverse().unwrap();
        let [before, after] = [o.before, o.after].map(|xi| (whiten * xi).norm());
        assert!(after < before + 1.0, "seed {seed}: {before} to {after} standard deviations");
    }
}

fn axis(k: usize) -> Twist {
    Twist::from_fn(|i, _| f64::from(i == k))
}

#[test]
fn the_three_rotations_of_a_ball_are_free() {
    for noise in [Noise::Laser, Noise::Stereo] {
        check_directions(ball, noise, &[axis(3), axis(4), axis(5)], &[axis(2)]);
    }
}

#[test]
fn rotation_and_slide_along_the_axis_of_a_cylinder_are_free() {
    for noise in [Noise::Laser, Noise::Stereo] {
        check_directions(cylinder, noise, &[axis(0), axis(3)], &[axis(2)]);
    }
}

#[test]
fn two_slides_and_a_rotation_of_a_plane_are_free() {
    for noise in [Noise::Laser, Noise::Stereo] {
        check_directions(plane, noise, &[axis(0), axis(1), axis(5)], &[axis(2)]);
    }
}

/// Ribs along y, 1 mm high and 10 mm apart, on a plane.
fn ribs(from: &Vec3, along: &Vec3) -> Option<f64> {
    let mut depth = -from.z / along.z;
    for _ in 0..20 {
        let x = from.x + along.x * depth;
        let height = 1e-3 * (x * std::f64::consts::TAU / 0.01).sin();
        depth = (height - from.z) / along.z;
    }
    Some(depth)
}

#[test]
fn ribs_that_repeat_are_ambiguous_unless_the_prior_excludes_the_others() {
    let params = RegisterParams::default();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (there, here) = (tilted_view(-0.15), tilted_view(0.15));
    let fixed = PairScan::new(&simulate_scan(ribs, Noise::Laser, &there, &mut rng), SIGMA, &params);
    let moving = PairScan::new(&simulate_scan(ribs, Noise::Laser, &here, &mut rng), SIGMA, &params);
    let truth = there.inverse() * here;
    // Along x of the object by a whole rib.
    let guess = there.inverse() * Pose::translation(0.0098, 0.0, 0.0) * here;
    // A standard deviation of 10 mm leaves several ribs possible, one of 1 mm a single one.
    let loose = about_the_middle() * (1e-2 / TRANSLATION_SIGMA).powi(2);
    let (_, unsure) = align_pair_with_covariance(&moving, &fixed, &guess, &loose, &params).unwrap();
    assert_eq!(unsure.status, Status::Deferred, "{}", unsure.reason);
    assert!(unsure.reason.contains("ambiguous"), "{}", unsure.reason);
    let guess = truth * Pose::translation(5e-4, 0.0, 0.0);
    let tight = about_the_middle() * (1e-3 / TRANSLATION_SIGMA).powi(2);
    let (_, sure) = align_pair_with_covariance(&moving, &fixed, &guess, &tight, &params).unwrap();
    assert!(sure.is_accepted(), "{}", sure.reason);
}
