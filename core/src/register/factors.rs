//! Residuals of a correspondence and their derivatives by the poses, perturbed on the right:
//! `T = T0 exp(xi)`, xi = (x, y, z, rx, ry, rz).

use crate::geometry::{Mat3, Pose, Twist, Vec3, skew};
use nalgebra::Matrix3x6;

/// Point-to-plane residual `n . (T p - m)` and its derivative by `T` (Chen & Medioni 1991).
///
/// `p` in the moving frame; `m` and the unit normal `n` in the fixed one.
pub fn point_to_plane(pose: &Pose, p: &Vec3, m: &Vec3, n: &Vec3) -> (f64, Twist) {
    let moved = pose.rotation * p + pose.translation.vector;
    let local = pose.rotation.inverse_transform_vector(n);
    let turn = p.cross(&local);
    (n.dot(&(moved - m)), Twist::new(local.x, local.y, local.z, turn.x, turn.y, turn.z))
}

/// Point-to-point residual `T p - m` and its derivative by `T` (Besl & McKay 1992).
pub fn point_to_point(pose: &Pose, p: &Vec3, m: &Vec3) -> (Vec3, Matrix3x6<f64>) {
    let rotation: Mat3 = pose.rotation.to_rotation_matrix().into_inner();
    let mut jacobian = Matrix3x6::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
    jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&(-rotation * skew(p)));
    (rotation * p + pose.translation.vector - m, jacobian)
}

/// Derivative of a point `p` (moving frame, metres) by the pose, in the moving frame: `[I, -p^]`.
pub fn point_motion(p: &Vec3) -> Matrix3x6<f64> {
    let mut moves = Matrix3x6::zeros();
    moves.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
    moves.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew(p));
    moves
}

/// Weight of Tukey's biweight for a residual `r` in units of its standard deviation; 4.685 keeps 95 % of
/// the efficiency of least squares under Gaussian noise (Huber & Ronchetti 2009, §7.8).
pub fn tukey(r: f64) -> f64 {
    let u = r / 4.685;
    if u.abs() >= 1.0 { 0.0 } else { (1.0 - u * u).powi(2) }
}

/// What Tukey's biweight minimises, for a residual `r` in units of its standard deviation: `r^2 / 2` for small ones, and
/// 4.685^2 / 6 for all beyond 4.685.
pub fn tukey_loss(r: f64) -> f64 {
    let u = (r / 4.685).abs().min(1.0);
    4.685 * 4.685 / 6.0 * (1.0 - (1.0 - u * u).powi(3))
}

/// The variance of a point along its surface's normal beside that within the surface (Segal, Haehnel & Thrun 2009, §III.B).
const FLATNESS: f64 = 1e-3;

/// Information of the difference of two points, each of which lies on its surface and somewhere on it: the inverse of
/// `C_b + R C_a R'` (Segal, Haehnel & Thrun 2009, Generalized-ICP, eq. 2).
///
/// `a` and `b` are the unit normals of the two in one frame. Two parallel planes have information 1 along their normal and
/// 1e-3 within. It belongs to the rotation at which the normals were taken, and is held while a step is computed.
pub fn combined_information(a: &Vec3, b: &Vec3) -> Mat3 {
    // Half of the variance along the normal is each point's; C = (1 / eps) I + (1 - 1 / eps) n n'.
    let inside = 0.5 / FLATNESS;
    let flat = Mat3::from_diagonal_element(2.0 * inside);
    let covariance = flat + (a * a.transpose() + b * b.transpose()) * (0.5 - inside);
    covariance.try_inverse().unwrap_or_else(Mat3::zeros)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::exp;

    const STEP: f64 = 1e-6;

    fn axis(k: usize) -> Twist {
        Twist::from_fn(|i, _| if i == k { STEP } else { 0.0 })
    }

    fn example() -> (Pose, Vec3, Vec3, Vec3) {
        (
            exp(&Twist::new(0.1, -0.3, 0.2, 0.4, 0.1, -0.7)),
            Vec3::new(0.3, -0.1, 0.7),
            Vec3::new(0.2, 0.5, -0.4),
            Vec3::new(1.0, -2.0, 0.5).normalize(),
        )
    }

    #[test]
    fn derivatives_agree_with_finite_differences() {
        let (ti, p, m, n) = example();
        let (_, plane) = point_to_plane(&ti, &p, &m, &n);
        let (_, point) = point_to_point(&ti, &p, &m);
        for k in 0..6 {
            let (up, down) = (exp(&axis(k)), exp(&-axis(k)));
            let slope = |f: &dyn Fn(&Pose) -> f64| (f(&up) - f(&down)) / (2.0 * STEP);
            assert!((slope(&|e| point_to_plane(&(ti * e), &p, &m, &n).0) - plane[k]).abs() < 1e-8);
            for row in 0..3 {
                let expected = slope(&|e| point_to_point(&(ti * e), &p, &m).0[row]);
                assert!((expected - point[(row, k)]).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn the_gradient_of_plane_to_plane_agrees_with_finite_differences() {
        let (ti, p, m, n) = example();
        let information = combined_information(&Vec3::new(0.6, 0.0, 0.8), &n);
        let cost = |pose: &Pose| {
            let (r, _) = point_to_point(pose, &p, &m);
            0.5 * r.dot(&(information * r))
        };
        let (r, jacobian) = point_to_point(&ti, &p, &m);
        let gradient = jacobian.transpose() * information * r;
        for k in 0..6 {
            let slope = (cost(&(ti * exp(&axis(k)))) - cost(&(ti * exp(&-axis(k))))) / (2.0 * STEP);
            assert!((slope - gradient[k]).abs() < 1e-8 * gradient.norm().max(1.0), "{k}: {slope}");
        }
    }

    #[test]
    fn tukey_forgets_outliers() {
        assert_eq!(tukey(0.0), 1.0);
        assert!(tukey(1.0) > 0.9);
        assert_eq!(tukey(5.0), 0.0);
    }

    #[test]
    fn planes_slide_along_each_other_and_keep_their_distance() {
        let information = combined_information(&Vec3::z(), &Vec3::z());
        let expected = Mat3::from_diagonal(&Vec3::new(FLATNESS, FLATNESS, 1.0));
        assert!((information - expected).norm() < 1e-9, "{information}");
        // Planes at right angles hold each other along both normals, each with the variance within the other.
        let crossed = combined_information(&Vec3::x(), &Vec3::z());
        assert!((crossed[(0, 0)] - 2.0 * FLATNESS).abs() < 1e-5 && crossed[(0, 2)].abs() < 1e-9);
        assert!((crossed[(1, 1)] - FLATNESS).abs() < 1e-9);
    }
}
