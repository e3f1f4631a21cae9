//! Pose perturbations of a given size, and the differences that registered poses have from the true
//! ones.

use crate::geometry::{Pose, Vec3, rigid_fit, transform};
use crate::simulate::random_direction;
use nalgebra::{Translation3, UnitQuaternion};
use rand_chacha::ChaCha8Rng;

/// The difference of two poses of a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseDifference {
    /// Angle between the two rotations, radians.
    pub angle: f64,
    /// Distance between the centroids of the scan's points under the two poses, metres.
    pub distance: f64,
}

/// Rotates `pose` (`object_from_sensor`) by exactly `angle` (radians) about `center` (sensor frame,
/// metres) and moves it by exactly `distance` (metres).
///
/// Rotation axis and direction of the motion are drawn uniformly from the sphere.
pub fn perturb_pose(
    pose: &Pose,
    center: &Vec3,
    angle: f64,
    distance: f64,
    rng: &mut ChaCha8Rng,
) -> Pose {
    let turn = UnitQuaternion::new(random_direction(rng) * angle);
    let shift = random_direction(rng) * distance;
    let about = Translation3::from(center - turn * center + shift);
    pose * Pose::from_parts(about, turn)
}

/// The difference of each estimated pose from the true one after one common rigid fit of all scans.
///
/// `points` holds some points of each scan (sensor frame, metres). Returns `None` if there are
/// fewer than three points in all.
pub fn pose_differences(
    estimates: &[Pose],
    truth: &[Pose],
    points: &[Vec<Vec3>],
) -> Option<Vec<PoseDifference>> {
    let fit = rigid_fit(&place_points(estimates, points), &place_points(truth, points))?;
    let scans = estimates.iter().zip(truth).zip(points);
    let differences = scans.map(|((estimate, truth), points)| {
        let centroid = points.iter().sum::<Vec3>() / points.len().max(1) as f64;
        let fitted = fit * estimate;
        PoseDifference {
            angle: (fitted.rotation.inverse() * truth.rotation).angle(),
            distance: (transform(&fitted, &centroid) - transform(truth, &centroid)).norm(),
        }
    });
    Some(differences.collect())
}

/// The points of all scans in the object frame.
fn place_points(poses: &[Pose], points: &[Vec<Vec3>]) -> Vec<Vec3> {
    poses.iter().zip(points).flat_map(|(t, p)| p.iter().map(move |p| transform(t, p))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Twist, exp, log};
    use rand::SeedableRng;

    #[test]
    fn a_perturbation_has_its_size_and_a_common_motion_is_none() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let truth = exp(&Twist::new(0.3, 0.1, -0.2, 0.5, 0.2, 0.9));
        let center = Vec3::new(0.02, -0.01, 0.4);
        let moved = perturb_pose(&truth, &center, 0.1, 0.005, &mut rng);
        let off = truth.inverse() * moved;
        assert!((off.rotation.angle() - 0.1).abs() < 1e-9);
        assert!(
            ((transform(&moved, &center) - transform(&truth, &center)).norm() - 0.005).abs() < 1e-9
        );
        assert!(log(&off).norm() > 0.1);
        let points = vec![vec![center, center + Vec3::x() * 0.03, center + Vec3::y() * 0.02]; 2];
        let common = exp(&Twist::new(0.01, 0.0, 0.0, 0.0, 0.2, 0.0));
        let same =
            pose_differences(&[common * truth, common * moved], &[truth, moved], &points).unwrap();
        assert!(same.iter().all(|d| d.angle < 1e-7 && d.distance < 1e-9));
        let off = pose_differences(&[moved, truth], &[truth, truth], &points).unwrap();
        assert!(off.iter().any(|d| d.angle > 0.04 && d.distance > 0.002));
    }
}
