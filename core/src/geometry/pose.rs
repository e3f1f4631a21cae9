//! Rigid transforms and their exponential coordinates.
//!
//! Twists are ordered (x, y, z, rx, ry, rz), metres and radians. Perturbations act on the right:
//! `T = T0 exp(xi)`, so `xi` is seen from the transform's source frame.

use super::{Mat3, Vec3};
use crate::{Error, Result};
use nalgebra::{Matrix4, Rotation3, Translation3, UnitQuaternion};

/// Rotation angle, radians, below which the closed form of the Jacobian loses more digits than the
/// series leaves out.
const MIN_CLOSED_FORM_ANGLE: f64 = 1e-5;
/// Largest distance of the last row of a matrix from 0 0 0 1.
const MAX_LAST_ROW_ERROR: f64 = 1e-6;
/// Largest distance of a rotation matrix from an orthonormal one.
const MAX_ORTHONORMALITY_ERROR: f64 = 1e-3;
/// Accuracy and number of the iterations that project a matrix to the nearest rotation.
const ROTATION_ACCURACY: f64 = 1e-15;
const MAX_ROTATION_ITERATIONS: usize = 100;

/// A rigid transform; `a_from_b * point_in_b` is the point in frame `a`.
pub type Pose = nalgebra::Isometry3<f64>;
/// A twist (x, y, z, rx, ry, rz).
pub type Twist = nalgebra::Vector6<f64>;
/// A covariance or information matrix over a [`Twist`].
pub type Mat6 = nalgebra::Matrix6<f64>;

/// The coordinates in frame `a` of a point that is given in frame `b`, metres. (`Pose * Vec3` would
/// only rotate: nalgebra takes a vector for a direction.)
///
/// ```
/// use puffer_core::geometry::{Pose, Vec3, transform};
///
/// let object_from_sensor = Pose::translation(0.0, 0.0, 0.3);
/// let point = transform(&object_from_sensor, &Vec3::new(0.1, 0.0, 0.2));
/// assert_eq!(point, Vec3::new(0.1, 0.0, 0.5));
/// ```
pub fn transform(a_from_b: &Pose, point: &Vec3) -> Vec3 {
    a_from_b.rotation * point + a_from_b.translation.vector
}

/// The matrix of the cross product: `skew(a) * b = a x b`.
pub fn skew(a: &Vec3) -> Mat3 {
    Mat3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

/// Exponential map of SE(3) (Barfoot 2017, State Estimation for Robotics, §7.1.3).
pub fn exp(xi: &Twist) -> Pose {
    let rho = Vec3::new(xi[0], xi[1], xi[2]);
    let phi = Vec3::new(xi[3], xi[4], xi[5]);
    Pose::from_parts(Translation3::from(left_jacobian(&phi) * rho), UnitQuaternion::new(phi))
}

/// Logarithm of SE(3), the inverse of [`exp`] for rotations below pi.
pub fn log(pose: &Pose) -> Twist {
    let phi = pose.rotation.scaled_axis();
    let rho = left_jacobian(&phi)
        .try_inverse()
        .map_or(pose.translation.vector, |inverse| inverse * pose.translation.vector);
    Twist::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z)
}

/// The left Jacobian of SO(3) (Barfoot 2017, eq. 7.37).
fn left_jacobian(phi: &Vec3) -> Mat3 {
    let angle = phi.norm();
    let cross = skew(phi);
    if angle < MIN_CLOSED_FORM_ANGLE {
        // The first three terms of the series: 1, 1 / 2! and 1 / 3!.
        return Mat3::identity() + cross / 2.0 + cross * cross / 6.0;
    }
    let square = angle * angle;
    Mat3::identity()
        + cross * ((1.0 - angle.cos()) / square)
        + cross * cross * ((angle - angle.sin()) / (square * angle))
}

/// Adjoint of a pose: `T exp(xi) = exp(adjoint(T) xi) T`.
pub fn adjoint(pose: &Pose) -> Mat6 {
    let rotation = pose.rotation.to_rotation_matrix().into_inner();
    let mut adjoint = Mat6::zeros();
    adjoint.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
    adjoint.fixed_view_mut::<3, 3>(3, 3).copy_from(&rotation);
    adjoint.fixed_view_mut::<3, 3>(0, 3).copy_from(&(skew(&pose.translation.vector) * rotation));
    adjoint
}

/// Reads a row-major 4 x 4 matrix.
///
/// # Errors
/// [`Error::Input`] if a number is not finite, the last row is not 0 0 0 1, or the rotation is not
/// orthonormal to 1e-3 or is a reflection. Smaller deviations (text with few digits) are projected
/// away.
pub fn pose_from_rows(rows: &[[f64; 4]; 4]) -> Result<Pose> {
    let matrix = Matrix4::from_fn(|r, c| rows[r][c]);
    if matrix.iter().any(|v| !v.is_finite()) {
        return Err(Error::input("the matrix holds a number that is not finite"));
    }
    if (matrix.row(3) - nalgebra::RowVector4::new(0.0, 0.0, 0.0, 1.0)).norm() > MAX_LAST_ROW_ERROR {
        return Err(Error::input("the last row of the matrix must be 0 0 0 1 (is it transposed?)"));
    }
    let rotation: Mat3 = matrix.fixed_view::<3, 3>(0, 0).into_owned();
    let deviation = (rotation.transpose() * rotation - Mat3::identity()).norm();
    if deviation > MAX_ORTHONORMALITY_ERROR || rotation.determinant() < 0.0 {
        return Err(Error::input(format!(
            "the matrix is not a rigid transform: its upper left 3 x 3 block has determinant {:.4} and \
             differs from a rotation by {deviation:.4}; remove scale, shear or mirroring",
            rotation.determinant()
        )));
    }
    let rotation = Rotation3::from_matrix_eps(
        &rotation,
        ROTATION_ACCURACY,
        MAX_ROTATION_ITERATIONS,
        Rotation3::identity(),
    );
    Ok(Pose::from_parts(
        Translation3::new(rows[0][3], rows[1][3], rows[2][3]),
        UnitQuaternion::from_rotation_matrix(&rotation),
    ))
}

/// Writes a pose as a row-major 4 x 4 matrix.
pub fn pose_to_rows(pose: &Pose) -> [[f64; 4]; 4] {
    let matrix = pose.to_homogeneous();
    std::array::from_fn(|r| std::array::from_fn(|c| matrix[(r, c)]))
}

/// The rigid transform that best maps `from[i]` onto `to[i]` in the least-squares sense
/// (Umeyama 1991, without scale); `None` with fewer than three pairs or unequal lengths.
pub fn rigid_fit(from: &[Vec3], to: &[Vec3]) -> Option<Pose> {
    if from.len() != to.len() || from.len() < 3 {
        return None;
    }
    let n = from.len() as f64;
    let from_mean = from.iter().sum::<Vec3>() / n;
    let to_mean = to.iter().sum::<Vec3>() / n;
    let covariance = from
        .iter()
        .zip(to)
        .fold(Mat3::zeros(), |sum, (a, b)| sum + (b - to_mean) * (a - from_mean).transpose());
    let svd = covariance.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let sign = (u.determinant() * v_t.determinant()).signum();
    let rotation = u * Mat3::from_diagonal(&Vec3::new(1.0, 1.0, sign)) * v_t;
    let rotation =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Some(Pose::from_parts(Translation3::from(to_mean - rotation * from_mean), rotation))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn twist() -> Twist {
        Twist::new(0.3, -0.2, 0.5, 0.4, -0.9, 0.2)
    }

    #[test]
    fn a_point_is_rotated_and_moved_as_by_the_matrix() {
        let (pose, point) = (exp(&twist()), Vec3::new(0.3, -0.7, 1.1));
        let expected = pose.to_homogeneous() * point.push(1.0);
        assert!((transform(&pose, &point) - expected.xyz()).norm() < 1e-15);
        assert!((transform(&pose.inverse(), &transform(&pose, &point)) - point).norm() < 1e-15);
    }

    #[test]
    fn the_left_jacobian_is_the_derivative_of_exp() {
        // Finite differences: exp(phi + d) = exp(J d) exp(phi) to first order.
        let phi = Vec3::new(0.4, -0.9, 0.2);
        let (jacobian, step) = (left_jacobian(&phi), 1e-6);
        for axis in 0..3 {
            let mut moved = phi;
            moved[axis] += step;
            let change = UnitQuaternion::new(moved) * UnitQuaternion::new(phi).inverse();
            let found = change.scaled_axis() / step;
            assert!((found - jacobian.column(axis)).norm() < 1e-5, "{axis}");
        }
    }

    #[test]
    fn log_inverts_exp() {
        for scale in [1.0, 1e-3, 1e-7, 0.0] {
            let xi = twist() * scale;
            assert!((log(&exp(&xi)) - xi).norm() < 1e-12);
        }
    }

    #[test]
    fn adjoint_moves_a_twist_to_the_left() {
        let pose = exp(&twist());
        let xi = Twist::new(0.01, 0.02, -0.03, 0.02, 0.01, 0.05);
        let difference = log(&((pose * exp(&xi)).inverse() * exp(&(adjoint(&pose) * xi)) * pose));
        assert!(difference.norm() < 1e-12);
    }

    #[test]
    fn a_scaled_matrix_is_refused_with_its_determinant() {
        let mut rows = pose_to_rows(&exp(&twist()));
        assert!(pose_from_rows(&rows).is_ok());
        for row in rows.iter_mut().take(3) {
            for value in row.iter_mut().take(3) {
                *value *= 1000.0;
            }
        }
        let error = pose_from_rows(&rows).unwrap_err().to_string();
        assert!(error.contains("determinant"), "{error}");
    }

    #[test]
    fn rigid_fit_finds_a_known_transform() {
        let pose = exp(&twist());
        let from: Vec<Vec3> = (0..10)
            .map(|i| Vec3::new((i as f64).sin(), (i as f64 * 2.0).cos(), i as f64 * 0.1))
            .collect();
        let to: Vec<Vec3> = from.iter().map(|p| transform(&pose, p)).collect();
        let fit = rigid_fit(&from, &to).unwrap();
        assert!(log(&(fit.inverse() * pose)).norm() < 1e-9);
    }
}
