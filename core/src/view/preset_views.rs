//! Views that need no knowledge of the object.

use super::looking_along;
use crate::geometry::{Pose, Vec3};

/// Elevations of the predefined views in the order in which they are tried, degrees: first from
/// above at a slant, where most of an object is seen, last from below.
const ELEVATIONS_DEG: [f64; 5] = [30.0, 60.0, 5.0, -30.0, -60.0];
/// Views at each elevation, every 45 degrees of azimuth.
const AZIMUTH_STEPS: usize = 8;
/// Azimuth of the first view, degrees: the front, -y of the object frame.
const FIRST_AZIMUTH_DEG: f64 = -90.0;
/// Number of directions of the evenly spread baseline.
const SPHERE_VIEWS: usize = 64;

/// Predefined views (`object_from_sensor`) of `center` from `distance` (metres) in the order in
/// which they are tried.
pub(crate) fn predefined_views(center: &Vec3, distance: f64) -> Vec<Pose> {
    let mut directions = Vec::new();
    for elevation in ELEVATIONS_DEG {
        let (up, out) = elevation.to_radians().sin_cos();
        for step in 0..AZIMUTH_STEPS {
            // A turn has 360 degrees.
            let turn = step as f64 / AZIMUTH_STEPS as f64 * 360.0;
            let azimuth = (turn + FIRST_AZIMUTH_DEG).to_radians();
            directions.push(Vec3::new(out * azimuth.cos(), out * azimuth.sin(), up));
        }
    }
    directions.extend([Vec3::z(), -Vec3::z()]);
    views_from(&directions, center, distance)
}

/// Views (`object_from_sensor`) of `center` from `distance` (metres) spread evenly over the sphere,
/// each as far as possible from those before it.
pub(crate) fn sphere_views(center: &Vec3, distance: f64) -> Vec<Pose> {
    let mut left = fibonacci_lattice(SPHERE_VIEWS);
    let mut taken: Vec<Vec3> = Vec::new();
    while !left.is_empty() {
        let next = (0..left.len())
            .min_by(|&a, &b| max_cosine(&left[a], &taken).total_cmp(&max_cosine(&left[b], &taken)));
        taken.push(left.remove(next.unwrap_or(0)));
    }
    views_from(&taken, center, distance)
}

/// The cosine of the angle between `direction` and the nearest of `others`; -1 without others.
fn max_cosine(direction: &Vec3, others: &[Vec3]) -> f64 {
    others.iter().map(|other| other.dot(direction)).fold(-1.0, f64::max)
}

/// Unit vectors that are spread evenly over the sphere (Fibonacci lattice).
fn fibonacci_lattice(count: usize) -> Vec<Vec3> {
    let golden_angle = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..count)
        .map(|i| {
            let z = 1.0 - (2 * i + 1) as f64 / count as f64;
            let (sin, cos) = (i as f64 * golden_angle).sin_cos();
            Vec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + Vec3::z() * z
        })
        .collect()
}

/// Views of `center` from `distance` (metres) in the unit vectors `directions`.
fn views_from(directions: &[Vec3], center: &Vec3, distance: f64) -> Vec<Pose> {
    directions.iter().map(|d| looking_along(&(center + d * distance), &-d)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_look_at_the_center_and_the_first_is_in_front_and_elevated() {
        let center = Vec3::new(0.1, 0.2, 0.3);
        let (predefined, sphere) = (predefined_views(&center, 0.5), sphere_views(&center, 0.5));
        assert_eq!((predefined.len(), sphere.len()), (42, 64));
        for pose in predefined.iter().chain(&sphere) {
            assert!((pose * nalgebra::Point3::new(0.0, 0.0, 0.5) - center).coords.norm() < 1e-9);
        }
        let first = predefined[0].translation.vector - center;
        assert!((first - Vec3::new(0.0, -0.433_013, 0.25)).norm() < 1e-5);
        // Any half of the sphere is looked at early: the first six are well apart.
        let directions: Vec<Vec3> = sphere.iter().map(|pose| pose.rotation * Vec3::z()).collect();
        for i in 1..6 {
            for j in 0..i {
                assert!(directions[i].angle(&directions[j]).to_degrees() > 45.0);
            }
        }
    }
}
