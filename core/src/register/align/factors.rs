//! Residuals of a correspondence and their derivatives by the poses, perturbed on the right:
//! `T = T0 exp(xi)`, xi = (x, y, z, rx, ry, rz).

use crate::geometry::{Mat3, Pose, TUKEY_CUTOFF_SIGMA, Twist, Vec3, skew, transform};
use nalgebra::Matrix3x6;

/// Point-to-plane residual `n . (T p - m)` and its derivative by `T` (Chen & Medioni 1991).
///
/// `p` in the moving frame; `m` and the unit normal `n` in the fixed one.
pub(crate) fn point_to_plane(pose: &Pose, p: &Vec3, m: &Vec3, n: &Vec3) -> (f64, Twist) {
    let moved = transform(pose, p);
    let local = pose.rotation.inverse_transform_vector(n);
    let turn = p.cross(&local);
    (n.dot(&(moved - m)), Twist::new(local.x, local.y, local.z, turn.x, turn.y, turn.z))
}

/// Point-to-point residual `T p - m` and its derivative by `T` (Besl & McKay 1992).
pub(crate) fn point_to_point(pose: &Pose, p: &Vec3, m: &Vec3) -> (Vec3, Matrix3x6<f64>) {
    let rotation: Mat3 = pose.rotation.to_rotation_matrix().into_inner();
    let mut jacobian = Matrix3x6::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
    jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&(-rotation * skew(p)));
    (rotation * p + pose.translation.vector - m, jacobian)
}

/// Derivative of a point `p` (moving frame, metres) by the pose, in the moving frame: `[I, -p^]`
/// (Barfoot 2017, State Estimation for Robotics, §7.1.8).
pub(crate) fn point_motion(p: &Vec3) -> Matrix3x6<f64> {
    let mut moves = Matrix3x6::zeros();
    moves.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
    moves.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew(p));
    moves
}

/// Median absolute deviation of a normal distribution, in its standard deviations.
pub(crate) const MAD_PER_SIGMA: f64 = 0.6745;
/// Variance of a point along its surface's normal, relative to that within the surface (Segal,
/// Haehnel & Thrun 2009, Generalized-ICP, §III.B).
const PLANE_VARIANCE_RATIO: f64 = 1e-3;

/// Weight of Tukey's biweight for a residual `r` in units of its standard deviation.
pub(crate) fn tukey(r: f64) -> f64 {
    let u = r / TUKEY_CUTOFF_SIGMA;
    if u.abs() >= 1.0 { 0.0 } else { (1.0 - u * u).powi(2) }
}

/// The loss that Tukey's biweight minimises, for a residual `r` in units of its standard deviation:
/// `r^2 / 2` for small residuals, and 4.685^2 / 6 for all beyond 4.685.
pub(crate) fn tukey_loss(r: f64) -> f64 {
    let u = (r / TUKEY_CUTOFF_SIGMA).abs().min(1.0);
    // The integral of r w(r).
    TUKEY_CUTOFF_SIGMA * TUKEY_CUTOFF_SIGMA / 6.0 * (1.0 - (1.0 - u * u).powi(3))
}

/// Information of the difference of two points, each of which is uncertain within its plane: the
/// inverse of `C_b + R C_a R'` (Segal, Haehnel & Thrun 2009, Generalized-ICP, eq. 2).
///
/// `a` and `b` are the unit normals of the two in one frame. Two parallel planes have information 1
/// along their normal and 1e-3 within. The information belongs to the rotation at which the normals
/// were taken, and is held while a step is computed.
pub(crate) fn combined_information(a: &Vec3, b: &Vec3) -> Mat3 {
    // With eps = PLANE_VARIANCE_RATIO, each point has the variance 1/2 along its normal and
    // 1 / (2 eps) within its plane: C = 1 / (2 eps) I + (1/2 - 1 / (2 eps)) n n'.
    let within = 0.5 / PLANE_VARIANCE_RATIO;
    let isotropic = Mat3::from_diagonal_element(2.0 * within);
    let covariance = isotropic + (a * a.transpose() + b * b.transpose()) * (0.5 - within);
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

    /// Central difference of `f` at `pose` by the `k`-th coordinate of the perturbation.
    fn central_difference(pose: &Pose, k: usize, f: impl Fn(&Pose) -> f64) -> f64 {
        (f(&(pose * exp(&axis(k)))) - f(&(pose * exp(&-axis(k))))) / (2.0 * STEP)
    }

    #[test]
    fn derivatives_agree_with_finite_differences() {
        let (pose, p, m, n) = example();
        let (_, plane) = point_to_plane(&pose, &p, &m, &n);
        let (_, point) = point_to_point(&pose, &p, &m);
        for k in 0..6 {
            let slope = central_difference(&pose, k, |at| point_to_plane(at, &p, &m, &n).0);
            assert!((slope - plane[k]).abs() < 1e-8);
            for row in 0..3 {
                let slope = central_difference(&pose, k, |at| point_to_point(at, &p, &m).0[row]);
                assert!((slope - point[(row, k)]).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn the_motion_of_a_point_is_that_of_the_pose_in_the_moving_frame() {
        let (pose, p, m, _) = example();
        let (_, in_fixed_frame) = point_to_point(&pose, &p, &m);
        let rotation = pose.rotation.to_rotation_matrix().into_inner();
        assert!((rotation * point_motion(&p) - in_fixed_frame).amax() < 1e-12);
    }

    #[test]
    fn the_gradient_of_plane_to_plane_agrees_with_finite_differences() {
        let (pose, p, m, n) = example();
        let information = combined_information(&Vec3::new(0.6, 0.0, 0.8), &n);
        let (r, jacobian) = point_to_point(&pose, &p, &m);
        let gradient = jacobian.transpose() * information * r;
        for k in 0..6 {
            let slope = central_difference(&pose, k, |at| {
                let (r, _) = point_to_point(at, &p, &m);
                0.5 * r.dot(&(information * r))
            });
            assert!((slope - gradient[k]).abs() < 1e-8 * gradient.norm().max(1.0), "{k}: {slope}");
        }
    }

    #[test]
    fn tukey_s_weight_is_the_slope_of_its_loss_over_the_residual() {
        for r in [0.1, 1.0, 3.0, 4.6, 5.0, -2.0] {
            let slope = (tukey_loss(r + STEP) - tukey_loss(r - STEP)) / (2.0 * STEP);
            assert!((slope - tukey(r) * r).abs() < 1e-6, "{r}: {slope}");
        }
        assert_eq!(tukey_loss(f64::INFINITY), 4.685 * 4.685 / 6.0);
    }

    #[test]
    fn tukey_gives_outliers_no_weight() {
        assert_eq!(tukey(0.0), 1.0);
        assert!(tukey(1.0) > 0.9);
        assert_eq!(tukey(5.0), 0.0);
    }

    #[test]
    fn planes_slide_along_each_other_and_keep_their_distance() {
        let information = combined_information(&Vec3::z(), &Vec3::z());
        let expected =
            Mat3::from_diagonal(&Vec3::new(PLANE_VARIANCE_RATIO, PLANE_VARIANCE_RATIO, 1.0));
        assert!((information - expected).norm() < 1e-9, "{information}");
        // Planes at right angles hold each other along both normals, each with the variance within
        // the other.
        let crossed = combined_information(&Vec3::x(), &Vec3::z());
        assert!(
            (crossed[(0, 0)] - 2.0 * PLANE_VARIANCE_RATIO).abs() < 1e-5
                && crossed[(0, 2)].abs() < 1e-9
        );
        assert!((crossed[(1, 1)] - PLANE_VARIANCE_RATIO).abs() < 1e-9);
    }
}
