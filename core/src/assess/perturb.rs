//! Poses moved off by a given amount, and how far registered ones are from where they were.

use super::align::apply;
use crate::geometry::{Pose, Vec3, rigid_fit};
use crate::simulate::direction;
use nalgebra::{Translation3, UnitQuaternion};
use rand_chacha::ChaCha8Rng;

/// `pose` (`object_from_sensor`) turned by exactly `angle` (radians) about `center` (sensor frame) and moved by exactly
/// `distance` (metres), each in a direction evenly spread over the sphere.
pub fn perturbed(
    pose: &Pose,
    center: &Vec3,
    angle: f64,
    distance: f64,
    rng: &mut ChaCha8Rng,
) -> Pose {
    let turn = UnitQuaternion::new(direction(rng) * angle);
    let shift = direction(rng) * distance;
    let about = Translation3::from(center - turn * center + shift);
    pose * Pose::from_parts(about, turn)
}

/// How far each pose is from the truth after one common rigid fit of all.
///
/// `points` holds some points of each scan, sensor frame, metres. Gives for each scan the angle (radians) and the
/// distance that its points' mean is off (metres); `None` if there are fewer than three points.
pub fn differences(
    found: &[Pose],
    truth: &[Pose],
    points: &[Vec<Vec3>],
) -> Option<Vec<(f64, f64)>> {
    let all = |poses: &[Pose]| -> Vec<Vec3> {
        poses.iter().zip(points).flat_map(|(t, p)| p.iter().map(move |p| apply(t, p))).collect()
    };
    let fit = rigid_fit(&all(found), &all(truth))?;
    let of_scan = |((found, truth), points): ((&Pose, &Pose), &Vec<Vec3>)| {
        let mean = points.iter().sum::<Vec3>() / points.len().max(1) as f64;
        let placed = fit * found;
        let angle = (placed.rotation.inverse() * truth.rotation).angle();
        (angle, (apply(&placed, &mean) - apply(truth, &mean)).norm())
    };
    Some(found.iter().zip(truth).zip(points).map(of_scan).collect())
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
        let moved = perturbed(&truth, &center, 0.1, 0.005, &mut rng);
        let off = truth.inverse() * moved;
        assert!((off.rotation.angle() - 0.1).abs() < 1e-9);
        assert!(((apply(&moved, &center) - apply(&truth, &center)).norm() - 0.005).abs() < 1e-9);
        assert!(log(&off).norm() > 0.1);
        let points = vec![vec![center, center + Vec3::x() * 0.03, center + Vec3::y() * 0.02]; 2];
        let common = exp(&Twist::new(0.01, 0.0, 0.0, 0.0, 0.2, 0.0));
        let same =
            differences(&[common * truth, common * moved], &[truth, moved], &points).unwrap();
        assert!(same.iter().all(|(angle, distance)| *angle < 1e-7 && *distance < 1e-9));
        let off = differences(&[moved, truth], &[truth, truth], &points).unwrap();
        assert!(off.iter().any(|(angle, distance)| *angle > 0.04 && *distance > 0.002));
    }
}
