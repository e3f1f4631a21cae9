use super::*;
use crate::assess::true_measurement::{MeasurementClass, TrueMeasurement};
use crate::filter::{FilterParams, filter};
use crate::geometry::{Pose, Vec3};
use crate::mesh::test_shapes::cuboid;
use crate::scan::PreparedScan;
use crate::simulate::{NoiseFamily, SimulateParams, TrueNoise, add_outliers, simulate};

fn cube(family: NoiseFamily, outliers: f64) -> (Mesh, SimulatedScans, Filtered) {
    let cube = cuboid(Vec3::zeros(), Vec3::new(0.06, 0.06, 0.06));
    let params = SimulateParams { family, views: 12, ..SimulateParams::default() };
    let mut scans = simulate(&cube, &params, 1, &Progress::silent()).unwrap();
    add_outliers(&mut scans, outliers, 0.05, 1);
    let prepared: Vec<PreparedScan> =
        scans.views.iter().map(|v| PreparedScan::new(&v.scan).unwrap()).collect();
    let posed: Vec<(&PreparedScan, Pose)> =
        prepared.iter().zip(&scans.views).map(|(p, v)| (p, v.true_pose)).collect();
    let filtered = filter(&posed, None, &FilterParams::default(), &Progress::silent()).unwrap();
    (cube, scans, filtered)
}

fn figures(case: &(Mesh, SimulatedScans, Filtered)) -> FilterFigures {
    filter_figures(&case.0, &case.1, &case.2, &Progress::silent()).unwrap()
}

#[test]
fn a_filter_that_refuses_nothing_or_all_has_no_recall_or_precision() {
    let mut case = cube(NoiseFamily::P1, 0.05);
    case.2.outliers.iter_mut().for_each(Vec::clear);
    let none = figures(&case);
    assert_eq!((none.recall, none.removed), (0.0, 0));
    let share = none.outliers as f64 / none.measurements as f64;
    assert!(share > 0.045 && share < 0.09, "{share}");
    for (refused, view) in case.2.outliers.iter_mut().zip(&case.1.views) {
        *refused = view.scan.returns().map(|i| i as u32).collect();
    }
    let all = figures(&case);
    assert_eq!(all.recall, 1.0);
    assert!((all.precision / share - 1.0).abs() < 0.1, "{all:?}");
    case.2.outliers.pop();
    assert!(filter_figures(&case.0, &case.1, &case.2, &Progress::silent()).is_err());
}

#[test]
fn a_cloud_moved_off_the_truth_has_that_error_and_bias() {
    let mut case = cube(NoiseFamily::P1, 0.0);
    let before = figures(&case);
    let cloud = &mut case.2.cloud;
    for i in 0..cloud.len() {
        cloud.points[i] += cloud.normals[i] * 2e-3;
        cloud.sigma[i] = 1e-3;
    }
    let moved = figures(&case);
    assert!((moved.bias - before.bias - 2.0).abs() < 0.05, "{moved:?}");
    assert!((moved.sigma - 1.0).abs() < 1e-9);
    assert!(moved.within_1_sigma < 0.02 && (moved.rms - 2.0).abs() < 0.1, "{moved:?}");
}

#[test]
fn the_limit_of_white_noise_is_twice_the_deviation_of_the_mean() {
    let noise = TrueNoise::new(NoiseFamily::P1, 100, 1);
    let grid = (0..21 * 21).map(|i| {
        let (x, y) = ((i % 21) as f64 - 10.0, (i / 21) as f64 - 10.0);
        TrueMeasurement {
            index: i,
            hit: Vec3::new(x, y, 0.0) * 1e-4,
            normal: Vec3::z(),
            sigma: 1e-4,
            class: MeasurementClass::Good,
            // One row: the arm has not wandered.
            noise,
            scan: i,
        }
    });
    let limits = LimitEstimator::new(vec![grid.collect()], 1e-3);
    let found = limits.limit_at(0, &Vec3::zeros(), &Vec3::z()).unwrap();
    // 317 grid points lie within ten steps.
    let count: f64 = 317.0;
    // In a disc evenly filled, the height of a quadric has twice the standard deviation of the
    // mean.
    let ratio = found.usual / (1e-4 / count.sqrt());
    assert!(ratio > 1.6 && ratio < 2.05, "{ratio}");
    // On one row the arm hardly wanders.
    assert!((found.oracle / found.usual - 1.0).abs() < 1e-3);
}
