//! Shapes that leave directions open: those are named, the pose stays where the prior is along them, and the covariance
//! says how far off the pose may be.

use super::*;
use crate::geometry::{Mat6, Scan, Twist, Vec3, exp, log};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Distance from the sensor to the shape's middle, metres.
const AWAY: f64 = 0.5;
/// Rays a side of the image, and their distance at the shape, metres.
const SIDE: usize = 130;
const PITCH: f64 = 1e-3;
/// What the guess is off by, a standard deviation an axis, about the shape's middle.
const SHIFT: f64 = 2e-3;
const TURN: f64 = 0.02;
const SEEDS: u64 = 12;

/// A shape about the origin: how far along a ray (from, unit direction) its surface is.
type Shape = fn(&Vec3, &Vec3) -> Option<f64>;

fn ball(from: &Vec3, along: &Vec3) -> Option<f64> {
    let half = from.dot(along);
    let inside = half * half - from.norm_squared() + 0.045 * 0.045;
    (inside > 0.0).then(|| -half - inside.sqrt())
}

/// Endless along x.
fn cylinder(from: &Vec3, along: &Vec3) -> Option<f64> {
    let flat = |v: &Vec3| Vec3::new(0.0, v.y, v.z);
    let (o, d) = (flat(from), flat(along));
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
    fn of(self, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let mut white = || -> Vec<f64> {
            (0..(SIDE + 6) * (SIDE + 6)).map(|_| rng.sample(StandardNormal)).collect()
        };
        let fine = white();
        let Noise::Stereo = self else {
            return (0..SIDE * SIDE).map(|i| fine[i] * 1e-4).collect();
        };
        let coarse = white();
        let smooth = |i: usize| -> f64 {
            let at = |k: usize| (i / SIDE + k / 6) * (SIDE + 6) + i % SIDE + k % 6;
            (0..36).map(|k| coarse[at(k)]).sum::<f64>() / 6.0
        };
        (0..SIDE * SIDE).map(|i| 0.9e-3 * smooth(i) + 0.4e-3 * fine[i]).collect()
    }
}

/// `shape`, seen by a camera at `pose` (`object_from_sensor`).
fn look(shape: Shape, noise: Noise, pose: &Pose, rng: &mut ChaCha8Rng) -> PreparedScan {
    let noise = noise.of(rng);
    let mut points = Vec::new();
    for (i, noise) in noise.iter().enumerate() {
        let at = |k: usize| (k as f64 - SIDE as f64 / 2.0) * PITCH;
        let ray = Vec3::new(at(i % SIDE), at(i / SIDE), AWAY).normalize();
        let Some(depth) = shape(&pose.translation.vector, &(pose.rotation * ray)) else { continue };
        let point = ray * (depth + noise);
        points.push([point.x as f32, point.y as f32, point.z as f32]);
    }
    PreparedScan::new(&Scan { points, ..Scan::default() }).unwrap()
}

/// `object_from_sensor` of a sensor that looks at the shape's middle, `tilt` radians from straight above.
fn eye(tilt: f64) -> Pose {
    let at = Vec3::new(AWAY * 0.3 * tilt, AWAY * tilt.sin(), AWAY * tilt.cos()).into();
    Pose::face_towards(&at, &nalgebra::Point3::origin(), &Vec3::x())
}

/// What the pose of a scan alone is known by.
const SIGMA: PoseSigma = PoseSigma { translation: SHIFT, rotation: TURN };

/// Covariance of a turn about the point (0, 0, AWAY) of the sensor frame and a shift.
fn about_the_middle() -> Mat6 {
    let of_middle = Mat6::from_fn(|r, c| {
        if r != c {
            0.0
        } else if r < 3 {
            SHIFT * SHIFT
        } else {
            TURN * TURN
        }
    });
    let to_sensor = crate::geometry::adjoint(&Pose::translation(0.0, 0.0, AWAY));
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
    let params = RegisterParams::default();
    let covariance = about_the_middle();
    let root = covariance.cholesky().unwrap().l();
    let one = |seed: u64| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (there, here) = (eye(-0.15), eye(0.15));
        let fixed = PairScan::new(&look(shape, noise, &there, &mut rng), SIGMA, &params);
        let moving = PairScan::new(&look(shape, noise, &here, &mut rng), SIGMA, &params);
        let truth = there.inverse() * here;
        let off: Twist = root * Twist::from_fn(|_, _| rng.sample(StandardNormal));
        let guess = truth * exp(&off);
        let (pose, verdict) =
            align_pair_within(&moving, &fixed, &guess, &covariance, &params).unwrap();
        Outcome {
            before: off,
            after: log(&(truth.inverse() * pose)),
            verdict,
            moving_from_object: crate::geometry::adjoint(&here.inverse()),
        }
    };
    (1..=SEEDS).map(one).collect()
}

/// The normalised estimation error squared of the six parameters, its mean over the seeds: 6 expected. Larger than
/// 12 would say that standard deviations are stated too small by more than a factor of 1.4.
fn mean_nees(outcomes: &[Outcome]) -> f64 {
    let nees = |o: &Outcome| o.after.dot(&(o.verdict.covariance.try_inverse().unwrap() * o.after));
    outcomes.iter().map(nees).sum::<f64>() / outcomes.len() as f64
}

/// The part of the unit twist `motion` (object frame) that lies in the span of the free directions, in units of the prior:
/// 1 for a free one.
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

fn check(shape: Shape, noise: Noise, open: &[Twist], known: &[Twist]) {
    let outcomes = outcomes(shape, noise);
    let nees = mean_nees(&outcomes);
    assert!(nees < 12.0, "nees {nees}");
    for (seed, o) in outcomes.iter().enumerate() {
        assert_eq!(o.verdict.status, Status::Accepted, "{seed}: {}", o.verdict.reason);
        assert!(o.verdict.free_directions.len() >= open.len(), "{seed}: {}", o.verdict.reason);
        assert!(o.verdict.reason.contains("left to the robot"), "{}", o.verdict.reason);
        for motion in open {
            let share = freedom(o, motion);
            assert!(share > 0.95, "seed {seed}: {motion} is free to {share}");
        }
        for motion in known {
            let share = freedom(o, motion);
            assert!(share < 0.5, "seed {seed}: {motion} is free to {share}");
        }
        // Along open directions the prior's own error remains; the geometry adds none.
        let whiten = about_the_middle().cholesky().unwrap().l().try_inverse().unwrap();
        let [before, after] = [o.before, o.after].map(|xi| (whiten * xi).norm());
        assert!(after < before + 1.0, "seed {seed}: {before} to {after} standard deviations");
    }
}

fn axis(k: usize) -> Twist {
    Twist::from_fn(|i, _| f64::from(i == k))
}

#[test]
fn a_balls_three_turns_are_open() {
    for noise in [Noise::Laser, Noise::Stereo] {
        check(ball, noise, &[axis(3), axis(4), axis(5)], &[axis(2)]);
    }
}

#[test]
fn a_cylinders_spin_and_slide_are_open() {
    for noise in [Noise::Laser, Noise::Stereo] {
        check(cylinder, noise, &[axis(0), axis(3)], &[axis(2)]);
    }
}

#[test]
fn a_planes_slides_and_turn_are_open() {
    for noise in [Noise::Laser, Noise::Stereo] {
        check(plane, noise, &[axis(0), axis(1), axis(5)], &[axis(2)]);
    }
}

/// Ribs along y, 1 mm high and 10 mm apart, on a plane.
fn ribs(from: &Vec3, along: &Vec3) -> Option<f64> {
    let height = |x: f64| 1e-3 * (x * std::f64::consts::TAU / 0.01).sin();
    let mut depth = -from.z / along.z;
    for _ in 0..20 {
        depth = (height(from.x + along.x * depth) - from.z) / along.z;
    }
    Some(depth)
}

#[test]
fn ribs_that_repeat_are_ambiguous_unless_the_prior_tells_them_apart() {
    let params = RegisterParams::default();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (there, here) = (eye(-0.15), eye(0.15));
    let fixed = PairScan::new(&look(ribs, Noise::Laser, &there, &mut rng), SIGMA, &params);
    let moving = PairScan::new(&look(ribs, Noise::Laser, &here, &mut rng), SIGMA, &params);
    let truth = there.inverse() * here;
    // Along x of the object by a whole rib.
    let guess = there.inverse() * Pose::translation(0.0098, 0.0, 0.0) * here;
    let align = |guess: &Pose, shift: f64| {
        let covariance = about_the_middle() * (shift / SHIFT).powi(2);
        align_pair_within(&moving, &fixed, guess, &covariance, &params).unwrap().1
    };
    let unsure = align(&guess, 1e-2);
    assert_eq!(unsure.status, Status::Deferred, "{}", unsure.reason);
    assert!(unsure.reason.contains("ambiguous"), "{}", unsure.reason);
    let sure = align(&(truth * Pose::translation(5e-4, 0.0, 0.0)), 1e-3);
    assert_eq!(sure.status, Status::Accepted, "{}", sure.reason);
}
