//! Estimates the uncertainty of the robot's poses from the scans themselves.

use super::registration_scan::RegistrationScan;
use crate::geometry::{KdTree, Pose, median, transform};
use crate::scan::PoseSigma;

/// Cosine of the angle within which the normals of one surface agree between two scans (37
/// degrees).
const MIN_NORMAL_COS: f64 = 0.8;
/// Distance beyond which two scans may show different surfaces, as a share of the object's size.
const MAX_DISTANCE_RATIO: f64 = 0.05;
/// The median absolute value of a normal deviate, in standard deviations.
const MEDIAN_PER_SIGMA: f64 = 0.67;
/// Closest points understate how far two surfaces are apart: by about half.
const CLOSEST_POINT_FACTOR: f64 = 2.0;
/// Smallest estimate of the deviation of a position, metres.
const MIN_TRANSLATION_SIGMA_M: f64 = 1e-5;
/// Smallest distance from the sensor that the deviation of the rotation is computed with, metres.
const MIN_SENSOR_DISTANCE_M: f64 = 1e-3;
/// Distance from the sensor where there are no scans, metres.
const DEFAULT_SENSOR_DISTANCE_M: f64 = 1.0;

/// Estimates the standard deviation from the distances between overlapping scans: their median,
/// point-to-plane, is 0.67 standard deviations of the sum of two pose errors and the noise.
pub(crate) fn estimate_pose_sigma(scans: &[RegistrationScan], robot: &[Pose]) -> PoseSigma {
    let mut distances = Vec::new();
    let reach = MAX_DISTANCE_RATIO * scans.iter().map(|s| s.extent).fold(0.0, f64::max);
    for (j, b) in scans.iter().enumerate() {
        let tree = KdTree::new(&b.map_points);
        for (i, a) in scans.iter().enumerate().filter(|(i, _)| *i != j) {
            let b_from_a = robot[j].inverse() * robot[i];
            distances.extend(plane_distances(a, b, &tree, &b_from_a, reach));
        }
    }
    let distance =
        median(scans.iter().map(|s| s.distance).collect()).unwrap_or(DEFAULT_SENSOR_DISTANCE_M);
    let spread = median(distances).unwrap_or(0.0) / MEDIAN_PER_SIGMA / std::f64::consts::SQRT_2;
    // Half of the variance is that of the translation, half that of the rotation.
    let half =
        (CLOSEST_POINT_FACTOR * spread / std::f64::consts::SQRT_2).max(MIN_TRANSLATION_SIGMA_M);
    PoseSigma { translation: half, rotation: half / distance.max(MIN_SENSOR_DISTANCE_M) }
}

/// Point-to-plane distances of the points of `a` to the nearest map points of `b` (over which
/// `tree` was built) within `reach`, metres.
fn plane_distances(
    a: &RegistrationScan,
    b: &RegistrationScan,
    tree: &KdTree,
    b_from_a: &Pose,
    reach: f64,
) -> impl Iterator<Item = f64> {
    a.points.iter().zip(&a.normals).filter_map(move |(p, normal)| {
        let seen = transform(b_from_a, p);
        let (target, _) = tree.nearest_within(&seen, reach)?;
        let target_normal = &b.map_normals[target];
        let agrees = target_normal.dot(&(b_from_a.rotation * normal)) >= MIN_NORMAL_COS;
        agrees.then(|| target_normal.dot(&(seen - b.map_points[target])).abs())
    })
}
