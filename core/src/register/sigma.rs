//! The uncertainty of the robot's poses.

use super::sample::Sample;
use crate::geometry::{KdTree, Mat6, Pose, median};
use crate::scans::PoseSigma;

/// No robot is better than this; it also keeps the information finite for poses called exact.
const BEST_TRANSLATION: f64 = 1e-6;
const BEST_ROTATION: f64 = 1e-6;

impl PoseSigma {
    /// The inverse of the covariance.
    pub(crate) fn information(&self) -> Mat6 {
        let translation = self.translation.max(BEST_TRANSLATION).powi(-2);
        let rotation = self.rotation.max(BEST_ROTATION).powi(-2);
        Mat6::from_diagonal(&nalgebra::Vector6::new(
            translation,
            translation,
            translation,
            rotation,
            rotation,
            rotation,
        ))
    }

    /// Standard deviation of a point at `distance` (metres) from the sensor.
    pub(crate) fn of_point(&self, distance: f64) -> f64 {
        self.translation.hypot(self.rotation * distance)
    }
}

/// Cosine within which the normals of one surface agree between two scans (37 degrees).
const ALIKE: f64 = 0.8;

/// Estimates the standard deviation from the distances between overlapping scans: their median,
/// point-to-plane, is 0.67 standard deviations of the sum of two errors and the noise.
pub(crate) fn estimate(samples: &[Sample], robot: &[Pose]) -> PoseSigma {
    let mut distances = Vec::new();
    // Scans farther apart than a twentieth of the object are no longer told from different surfaces.
    let reach = 0.05 * samples.iter().map(|s| s.extent).fold(0.0, f64::max);
    for (j, b) in samples.iter().enumerate() {
        let tree = KdTree::new(&b.targets);
        for (i, a) in samples.iter().enumerate().filter(|(i, _)| *i != j) {
            let b_from_a = robot[j].inverse() * robot[i];
            distances.extend(distances_to(a, b, &tree, &b_from_a, reach));
        }
    }
    let distance = median(samples.iter().map(|s| s.distance).collect()).unwrap_or(1.0);
    let spread = median(distances).unwrap_or(0.0) / 0.67 / std::f64::consts::SQRT_2;
    // Half of the variance to translation, half to rotation; doubled, because closest points understate it.
    let half = (2.0 * spread / std::f64::consts::SQRT_2).max(1e-5);
    PoseSigma { translation: half, rotation: half / distance.max(1e-3) }
}

/// Point-to-plane distances of the points of `a` to the nearest targets of `b` (over which `tree` was built) within
/// `reach`, metres.
fn distances_to(
    a: &Sample,
    b: &Sample,
    tree: &KdTree,
    b_from_a: &Pose,
    reach: f64,
) -> impl Iterator<Item = f64> {
    a.points.iter().zip(&a.normals).filter_map(move |(p, normal)| {
        let seen = b_from_a.rotation * p + b_from_a.translation.vector;
        let (target, _) = tree.nearest_within(&seen, reach)?;
        let there = &b.target_normals[target];
        let alike = there.dot(&(b_from_a.rotation * normal)) >= ALIKE;
        alike.then(|| there.dot(&(seen - b.targets[target])).abs())
    })
}
