use super::*;
use crate::geometry::{Scan, Twist, Vec3, exp, log, transform};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Points of a lumpy closed surface (no symmetry), seen from `pose`.
fn simulate_blob_scan(pose: &Pose, rng: &mut ChaCha8Rng) -> Scan {
    let mut points = Vec::new();
    for i in 0..120 {
        for j in 0..240 {
            let (theta, phi) = ((f64::from(i) + 0.5) * 0.0261, f64::from(j) * 0.0261);
            let u = Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
            let radius =
                0.05 * (1.0 + 0.25 * u.x * u.y + 0.2 * u.z * u.x + 0.15 * (4.0 * u.y).sin());
            let object = u * radius + Vec3::new(0.0, 0.0, 1e-4 * rng.random_range(-1.0..1.0));
            let seen = pose.inverse_transform_point(&object.into()).coords;
            if (pose.rotation.inverse() * u).z < -0.2 {
                points.push([seen.x as f32, seen.y as f32, seen.z as f32]);
            }
        }
    }
    Scan { points, ..Scan::default() }
}

fn true_poses() -> Vec<Pose> {
    (0..8)
        .map(|k| {
            let angle = f64::from(k) * std::f64::consts::FRAC_PI_4;
            let eye = Vec3::new(0.3 * angle.cos(), 0.3 * angle.sin(), 0.1).into();
            Pose::face_towards(&eye, &nalgebra::Point3::origin(), &Vec3::z())
        })
        .collect()
}

fn random_twist(rng: &mut ChaCha8Rng, translation: f64, rotation: f64) -> Twist {
    Twist::from_fn(|i, _| rng.random_range(-1.7..1.7) * if i < 3 { translation } else { rotation })
}

pub(super) struct Case {
    pub scans: Vec<PreparedScan>,
    pub robot: Vec<Pose>,
    pub truth: Vec<Pose>,
}

/// Root mean square distance along the normals between where `fixed_from_moving` and the truth put
/// the points of scan `moving`, metres.
pub(super) fn pair_error(
    case: &Case,
    moving: usize,
    fixed: usize,
    fixed_from_moving: &Pose,
) -> f64 {
    let truth = case.truth[fixed].inverse() * case.truth[moving];
    let error = truth.inverse() * fixed_from_moving;
    let scan = &case.scans[moving];
    let distances =
        scan.points.iter().zip(&scan.normals).map(|(p, n)| n.dot(&(transform(&error, p) - p)));
    (distances.map(|distance| distance.powi(2)).sum::<f64>() / scan.points.len() as f64).sqrt()
}

pub(super) fn case(sigma: PoseSigma) -> Case {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let truth = true_poses();
    let scans = truth
        .iter()
        .map(|pose| PreparedScan::new(&simulate_blob_scan(pose, &mut rng)).unwrap())
        .collect();
    let robot = truth
        .iter()
        .map(|pose| pose * exp(&random_twist(&mut rng, sigma.translation, sigma.rotation)))
        .collect();
    Case { scans, robot, truth }
}

/// Largest error of the poses relative to their common rigid offset: metres at 50 mm from the
/// origin.
fn max_error(poses: &[Pose], truth: &[Pose]) -> f64 {
    let offset = truth[0] * poses[0].inverse();
    poses
        .iter()
        .zip(truth)
        .map(|(p, t)| {
            let xi = log(&((offset * p) * t.inverse()));
            xi.fixed_rows::<3>(0).norm() + 0.05 * xi.fixed_rows::<3>(3).norm()
        })
        .fold(0.0, f64::max)
}

pub(super) const SIGMA: PoseSigma = PoseSigma { translation: 0.002, rotation: 0.006 };

#[test]
fn poses_come_back_and_every_scan_is_accepted() {
    let case = case(SIGMA);
    let params = RegisterParams::default();
    let result =
        register(&case.scans, &case.robot, Some(SIGMA), &params, &Progress::silent()).unwrap();
    for verdict in &result.verdicts {
        assert!(verdict.is_accepted(), "{}", verdict.reason);
    }
    let (before, after) =
        (max_error(&case.robot, &case.truth), max_error(&result.poses, &case.truth));
    assert!(before > 2e-3 && after < 1.5e-4, "{before} {after}");
    let residual = result.residual.unwrap();
    assert!(residual < 2e-4, "{residual}");
}

#[test]
fn the_sigma_is_estimated_when_the_robot_gives_none() {
    let case = case(SIGMA);
    let params = RegisterParams::default();
    let result = register(&case.scans, &case.robot, None, &params, &Progress::silent()).unwrap();
    let ratio = result.pose_sigma.translation / SIGMA.translation;
    assert!(ratio > 0.3 && ratio < 3.0, "{ratio}");
    assert!(max_error(&result.poses, &case.truth) < 2e-4);
}

#[test]
fn the_thesis_registers_too_and_less_well() {
    let case = case(SIGMA);
    let params = RegisterParams {
        method: RegistrationMethod::Thesis,
        radius: 0.003,
        ..RegisterParams::default()
    };
    let result =
        register(&case.scans, &case.robot, Some(SIGMA), &params, &Progress::silent()).unwrap();
    let unregistered = Registration::exact(&case.scans, &case.robot).residual.unwrap();
    let default = register(
        &case.scans,
        &case.robot,
        Some(SIGMA),
        &RegisterParams::default(),
        &Progress::silent(),
    )
    .unwrap();
    let residual = result.residual.unwrap();
    assert!(residual < 0.7 * unregistered, "{residual} {unregistered}");
    assert!(default.residual.unwrap() < residual);
}

#[test]
fn a_scan_of_something_else_is_refused_with_the_reason() {
    let mut case = case(SIGMA);
    let alien: Vec<[f32; 3]> = (0..4000)
        .map(|i| {
            [
                (i % 63) as f32 * 1e-3 - 0.03,
                (i / 63) as f32 * 1e-3 - 0.03,
                0.15 + (i % 63) as f32 * 2e-3,
            ]
        })
        .collect();
    case.scans[4] = PreparedScan::new(&Scan { points: alien, ..Scan::default() }).unwrap();
    let params = RegisterParams::default();
    let result =
        register(&case.scans, &case.robot, Some(SIGMA), &params, &Progress::silent()).unwrap();
    assert_eq!(result.verdicts[4].status, Status::Refused);
    assert!(!result.verdicts[4].reason.is_empty());
    assert_eq!(result.verdicts.iter().filter(|v| v.is_accepted()).count(), 7);
    assert_eq!(result.poses[4], case.robot[4]);
}

#[test]
fn a_correction_beyond_three_sigma_is_refused() {
    let mut case = case(PoseSigma { translation: 1e-4, rotation: 3e-4 });
    let sigma = PoseSigma { translation: 1e-4, rotation: 3e-4 };
    case.robot[3] *= exp(&Twist::new(0.0, 0.004, 0.0, 0.0, 0.0, 0.0));
    let params = RegisterParams { radius: 0.01, ..RegisterParams::default() };
    let result =
        register(&case.scans, &case.robot, Some(sigma), &params, &Progress::silent()).unwrap();
    assert_eq!(result.verdicts[3].status, Status::Refused, "{}", result.verdicts[3].reason);
    assert!(result.verdicts[3].reason.contains("beyond 3"), "{}", result.verdicts[3].reason);
}

#[test]
fn one_and_two_threads_give_the_same_bits() {
    let case = case(SIGMA);
    let params = RegisterParams::default();
    let [one, two] = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            register(&case.scans, &case.robot, Some(SIGMA), &params, &Progress::silent()).unwrap()
        })
    });
    assert_eq!(one.poses, two.poses);
}

#[test]
fn a_cancelled_registration_stops() {
    let case = case(SIGMA);
    let progress = Progress::silent();
    progress.cancel();
    let outcome =
        register(&case.scans, &case.robot, Some(SIGMA), &RegisterParams::default(), &progress);
    assert!(matches!(outcome, Err(Error::Cancelled)));
}

#[test]
fn scans_taken_one_by_one_are_registered_deferred_and_refined_as_all_at_once() {
    let case = case(SIGMA);
    // The noise of these scans is white: its neighbours tell something new.
    let params = RegisterParams { information_share: 0.1, ..RegisterParams::default() };
    let mut registrar = Registrar::new(SIGMA, params.clone());
    // The fourth looks from the other side: it has to wait for those between.
    let order = [0, 4, 1, 2, 3, 5, 6, 7];
    let mut placed_later = Vec::new();
    for (n, &i) in order.iter().enumerate() {
        let changed = registrar.add(&case.scans[i], &case.robot[i]);
        assert_eq!(changed[0], n);
        placed_later.extend_from_slice(&changed[1..]);
    }
    assert_eq!(placed_later, [1], "the scan from the other side was not tried again");
    for n in 0..order.len() {
        assert!(registrar.verdict(n).is_accepted(), "{}", registrar.verdict(n).reason);
    }
    let [robot, truth] =
        [&case.robot, &case.truth].map(|all| order.iter().map(|&i| all[i]).collect::<Vec<Pose>>());
    let poses: Vec<Pose> = (0..order.len()).map(|n| registrar.pose(n)).collect();
    let off = max_error(&poses, &truth);
    assert!(off < 5e-4, "{off}");

    let refined = registrar.refine(&Progress::silent()).unwrap();
    let scans: Vec<PreparedScan> = order.iter().map(|&i| case.scans[i].clone()).collect();
    let at_once = register(&scans, &robot, Some(SIGMA), &params, &Progress::silent()).unwrap();
    assert_eq!(refined.poses, at_once.poses);
    assert_eq!(registrar.pose(3), at_once.poses[3]);
}

#[test]
fn a_pair_comes_together_whatever_the_order() {
    let case = case(SIGMA);
    let params = RegisterParams::default();
    let ready: Vec<PairScan> =
        case.scans.iter().map(|s| PairScan::new(s, SIGMA, &params)).collect();
    for (moving, fixed) in [(0, 1), (1, 0), (5, 4)] {
        let [guess, truth] =
            [&case.robot, &case.truth].map(|poses| poses[fixed].inverse() * poses[moving]);
        let (pose, verdict) = align_pair(&ready[moving], &ready[fixed], &guess, SIGMA, &params);
        assert!(verdict.is_accepted(), "{}", verdict.reason);
        let [before, after] = [guess, pose].map(|p| log(&(truth.inverse() * p)).norm());
        assert!(after < 0.5 * before, "{moving} to {fixed}: {before} to {after}");
    }
}

/// The first of the scans is of something else.
fn with_foreign_first_scan() -> Case {
    let mut case = case(SIGMA);
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let points = (0..8000)
        .map(|_| [0.0, 0.0, 0.3].map(|center| rng.random_range(-0.05..0.05_f32) + center))
        .collect();
    case.scans[0] = PreparedScan::new(&Scan { points, ..Scan::default() }).unwrap();
    case
}

#[test]
fn a_first_scan_that_nothing_overlaps_with_does_not_stop_the_others() {
    let case = with_foreign_first_scan();
    let params = RegisterParams::default();
    let progress = Progress::silent();
    let found = register(&case.scans, &case.robot, Some(SIGMA), &params, &progress).unwrap();
    assert_eq!(found.verdicts[0].status, Status::Refused);
    for verdict in &found.verdicts[1..] {
        assert!(verdict.is_accepted(), "{}", verdict.reason);
    }
    let off = max_error(&found.poses[1..], &case.truth[1..]);
    assert!(off < 5e-4, "{off}");
}

#[test]
fn scans_that_wait_and_fit_each_other_join_together() {
    let case = with_foreign_first_scan();
    let mut registrar = Registrar::new(SIGMA, RegisterParams::default());
    registrar.add(&case.scans[0], &case.robot[0]);
    assert_eq!(registrar.add(&case.scans[1], &case.robot[1]), [1]);
    assert_eq!(registrar.verdict(1).status, Status::Deferred);
    assert_eq!(registrar.add(&case.scans[2], &case.robot[2]), [2, 1]);
    for i in [1, 2] {
        assert!(registrar.verdict(i).is_accepted());
    }
    assert_eq!(registrar.pose(1), case.robot[1]);
    let found = registrar.pose(1).inverse() * registrar.pose(2);
    let truth = case.truth[1].inverse() * case.truth[2];
    assert!(log(&(truth.inverse() * found)).norm() < 5e-3, "{found} {truth}");
}

#[test]
fn a_scan_in_a_wrong_minimum_is_moved_and_no_other() {
    let case = case(SIGMA);
    let strategy = Strategy::new(&RegisterParams::default());
    let sampled = sample_all(&case.scans, SIGMA, &strategy);
    let scans: Vec<&RegistrationScan> = sampled.iter().collect();
    let mut registration = Registration::exact(&case.scans, &case.truth);
    registration.pose_sigma = SIGMA;
    for verdict in &mut registration.verdicts {
        verdict.free_directions = vec![Twist::x()];
    }
    registration.poses[3] *= exp(&Twist::new(0.01, -0.008, 0.0, 0.03, 0.0, 0.02));
    assert_eq!(judge::relocalize(&scans, &case.robot, &mut registration, &strategy), 1);
    let off = log(&(registration.poses[3].inverse() * case.truth[3]));
    assert!(off.norm() < 5e-3, "{off}");
    assert_eq!(registration.poses[2], case.truth[2]);
}
