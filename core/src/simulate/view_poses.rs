//! Viewpoints spread over the sphere.

use crate::geometry::{Aabb, Pose, Vec3};
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};

/// A viewing axis whose horizontal part is shorter than this counts as vertical.
const MIN_HORIZONTAL_NORM: f64 = 1e-9;

/// `count` poses `object_from_sensor` at `distance` (metres) from the middle of `aabb`, spread
/// evenly over the whole sphere (Fibonacci lattice; Gonzalez 2010, Math. Geosci. 42). Sensors look
/// at the middle (z forward), the image upright (y towards the object's -z).
pub fn view_poses(aabb: &Aabb, distance: f64, count: usize) -> Vec<Pose> {
    let golden_angle = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..count)
        .map(|i| {
            let height = 1.0 - (2 * i + 1) as f64 / count as f64;
            let (sin, cos) = (i as f64 * golden_angle).sin_cos();
            let radius = (1.0 - height * height).sqrt();
            look_at(&aabb.center(), &Vec3::new(radius * cos, radius * sin, height), distance)
        })
        .collect()
}

/// The pose `object_from_sensor` at `distance` (metres) from `center` in the unit `direction`, from
/// which the sensor looks at `center`.
fn look_at(center: &Vec3, direction: &Vec3, distance: f64) -> Pose {
    let z = -direction;
    // Straight up or down, the image's right is the object's x.
    let x = (-Vec3::z()).cross(&z).try_normalize(MIN_HORIZONTAL_NORM).unwrap_or_else(Vec3::x);
    let rotation = Matrix3::from_columns(&[x, z.cross(&x), z]);
    Pose::from_parts(
        Translation3::from(center + direction * distance),
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_look_at_the_middle_upright_and_well_spread() {
        let aabb = Aabb { min: Vec3::new(-1.0, -1.0, 0.0), max: Vec3::new(1.0, 1.0, 4.0) };
        let poses = view_poses(&aabb, 3.0, 26);
        for pose in &poses {
            let middle = pose.inverse_transform_point(&nalgebra::Point3::new(0.0, 0.0, 2.0));
            assert!((middle.coords - Vec3::z() * 3.0).norm() < 1e-12);
            assert!((pose.rotation * Vec3::y()).z <= 1e-12);
            let axis = pose.rotation * Vec3::z();
            let others = poses.iter().filter(|other| *other != pose);
            let nearest = others.map(|other| (other.rotation * Vec3::z()).angle(&axis));
            let degrees = nearest.fold(f64::INFINITY, f64::min).to_degrees();
            // 26 even caps are 45 degrees wide.
            assert!((28.0..50.0).contains(&degrees), "{degrees}");
        }
    }

    #[test]
    fn one_view_straight_down_is_a_rotation() {
        let pose = look_at(&Vec3::zeros(), &Vec3::z(), 1.0);
        let matrix = pose.rotation.to_rotation_matrix();
        assert!((matrix.matrix().determinant() - 1.0).abs() < 1e-12);
        assert!((pose.rotation * Vec3::z() + Vec3::z()).norm() < 1e-12);
    }
}
