use super::*;
use crate::geometry::{Scan, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

const NOISE: f64 = 2e-4;

/// A plane patch of 60 x 60 mm, 0.3 m before the sensor, with noise along the ray and some
/// outliers.
fn plane(seed: u64, outliers: usize) -> PreparedScan {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let noise = Normal::new(0.0, NOISE).unwrap();
    let mut points: Vec<[f32; 3]> = (0..120 * 120)
        .map(|i| {
            let (x, y) = (f64::from(i % 120) * 5e-4, f64::from(i / 120) * 5e-4);
            [x as f32, y as f32, (0.3 + noise.sample(&mut rng)) as f32]
        })
        .collect();
    for _ in 0..outliers {
        points.push([
            rng.random_range(0.0..0.06),
            rng.random_range(0.0..0.06),
            0.3 - rng.random_range(0.004..0.05),
        ]);
    }
    PreparedScan::new(&Scan { points, ..Scan::default() }).unwrap()
}

fn filtered(method: FilterMethod, tune: impl Fn(&mut FilterParams)) -> Filtered {
    let scans: Vec<PreparedScan> = (0..6).map(|seed| plane(seed, 150)).collect();
    let list: Vec<(&PreparedScan, Pose)> = scans.iter().map(|s| (s, Pose::identity())).collect();
    let mut params = FilterParams { method, ..FilterParams::default() };
    tune(&mut params);
    filter(&list, Some(NOISE), &params, &Progress::silent()).unwrap()
}

fn errors(cloud: &Cloud) -> (f64, f64) {
    let worst = cloud.points.iter().map(|p| (p.z - 0.3).abs()).fold(0.0, f64::max);
    let square: f64 = cloud.points.iter().map(|p| (p.z - 0.3).powi(2)).sum();
    ((square / cloud.len() as f64).sqrt(), worst)
}

#[test]
fn the_weighted_filter_averages_the_noise_and_drops_outliers() {
    let result = filtered(FilterMethod::Weighted, |_| ());
    let (rms, worst) = errors(&result.cloud);
    assert!(rms < NOISE / 4.0 && worst < 2.0 * NOISE, "{rms} {worst}");
    assert!(result.cloud.normals.iter().all(|n| n.dot(&-Vec3::z()) > 0.95));
    let ratio = result.cloud.sigma.iter().sum::<f64>() / result.cloud.len() as f64 / rms;
    assert!(ratio > 0.5 && ratio < 2.5, "stated sigma / true error = {ratio}");
    assert!(result.cloud.support.iter().filter(|s| **s == 6).count() > result.cloud.len() * 9 / 10);
}

#[test]
fn the_thesis_filter_averages_too() {
    let result = filtered(FilterMethod::Thesis, |p| {
        p.noise_radius = 2e-3;
        p.reduction_radius = 1e-3;
    });
    let (rms, worst) = errors(&result.cloud);
    assert!(rms < NOISE / 1.5 && worst < 2e-3, "{rms} {worst}");
}

#[test]
fn the_reduction_radius_sets_the_distance_of_the_points() {
    let [dense, sparse] = [1e-3, 2e-3].map(|radius| {
        filtered(FilterMethod::Weighted, |p| p.reduction_radius = radius).cloud.len() as f64
    });
    let ratio = dense / sparse;
    assert!(ratio > 3.0 && ratio < 5.0, "{ratio}");
}

#[test]
fn opposite_sides_of_a_thin_wall_stay_apart() {
    let front = plane(1, 0);
    let back = plane(2, 0);
    // The second scan looks at the wall's other side, 1 mm behind the first.
    let turn = Pose::from_parts(
        nalgebra::Translation3::new(0.06, 0.0, 0.601),
        nalgebra::UnitQuaternion::from_axis_angle(&Vec3::y_axis(), std::f64::consts::PI),
    );
    let params = FilterParams { noise_radius: 2e-3, ..FilterParams::default() };
    let result = filter(
        &[(&front, Pose::identity()), (&back, turn)],
        Some(NOISE),
        &params,
        &Progress::silent(),
    )
    .unwrap();
    for (p, n) in result.cloud.points.iter().zip(&result.cloud.normals) {
        let expected = if n.z < 0.0 { 0.3 } else { 0.301 };
        assert!((p.z - expected).abs() < 2.5 * NOISE, "{p} {n}");
    }
}

#[test]
fn one_and_two_threads_give_the_same_bits() {
    let [one, two] = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| filtered(FilterMethod::Weighted, |_| ()).cloud)
    });
    assert_eq!(one, two);
}

#[test]
fn nothing_left_says_what_to_change() {
    let scan = plane(1, 0);
    let params = FilterParams { min_measurements: 1_000_000, ..FilterParams::default() };
    let error = filter(&[(&scan, Pose::identity())], Some(NOISE), &params, &Progress::silent())
        .unwrap_err();
    assert!(error.to_string().contains("filter.min_measurements"), "{error}");
}
