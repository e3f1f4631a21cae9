//! Inverse kinematics of a view by damped least squares (Buss 2004, Introduction to inverse
//! kinematics with Jacobian transpose, pseudoinverse and damped least squares methods, section 5),
//! with the joint limits as an active set.

use super::kinematic_chain::KinematicChain;
use crate::geometry::{Mat6, Pose, Twist, log};

/// A view is reached when the twist from it to the target is shorter than this (metres and
/// radians).
const TWIST_TOLERANCE: f64 = 1e-7;
/// Largest step of a position in one iteration, radians or metres.
const MAX_STEP: f64 = 0.5;
/// Square of the damping, per square of the error: the damping is strong far from the target, where
/// it keeps steps near singularities short, and vanishes at the target.
const DAMPING_RATIO: f64 = 0.05;
/// Least square of the damping, which keeps the normal matrix positive definite at a singularity.
const MIN_DAMPING: f64 = 1e-10;
/// An iteration makes progress if it reduces the error to less than this share of the best so far.
const PROGRESS_RATIO: f64 = 0.9;
/// Number of iterations without progress after which the search is given up.
const MAX_STALLED_ITERATIONS: usize = 10;

/// How the search may change the positions of the chain.
#[derive(Clone, Debug)]
pub(crate) struct PositionBounds {
    /// Lowest and highest value of each position.
    pub limits: Vec<[f64; 2]>,
    /// Weight of each position, the inverse of the cost of moving it; 0 keeps it where it is.
    pub weights: Vec<f64>,
}

/// Searches positions near `start` that bring the view of the chain to `target` (`base_from_view`);
/// `None` if it does not get there within `max_iterations`.
pub(crate) fn solve_inverse_kinematics(
    chain: &KinematicChain,
    target: &Pose,
    start: &[f64],
    bounds: &PositionBounds,
    max_iterations: usize,
) -> Option<Vec<f64>> {
    let mut x = start.to_vec();
    let mut jacobian = Vec::new();
    let (mut least_error, mut stalled) = (f64::INFINITY, 0);
    for _ in 0..max_iterations {
        let error = log(&(chain.view_with_jacobian(&x, &mut jacobian).inverse() * target));
        let size = error.norm();
        if size < TWIST_TOLERANCE {
            return Some(x);
        }
        if size < PROGRESS_RATIO * least_error {
            (least_error, stalled) = (size, 0);
        } else {
            stalled += 1;
            if stalled > MAX_STALLED_ITERATIONS {
                return None;
            }
        }
        let step = solve_damped_step(&jacobian, &error, &x, bounds)?;
        let largest = step.iter().fold(0.0, |m: f64, s| m.max(s.abs()));
        let scale = (MAX_STEP / largest).min(1.0);
        for ((x, s), [low, high]) in x.iter_mut().zip(&step).zip(&bounds.limits) {
            *x = (*x + s * scale).clamp(*low, *high);
        }
    }
    None
}

/// The damped step W J' (J W J' + damping I)^-1 error. Positions at a limit that it would leave are
/// fixed, and the step of the others is computed again.
fn solve_damped_step(
    jacobian: &[Twist],
    error: &Twist,
    x: &[f64],
    bounds: &PositionBounds,
) -> Option<Vec<f64>> {
    let mut weights = bounds.weights.clone();
    let damping = DAMPING_RATIO * error.norm_squared() + MIN_DAMPING;
    loop {
        let mut normal = Mat6::identity() * damping;
        for (column, weight) in jacobian.iter().zip(&weights) {
            if *weight > 0.0 {
                normal += column * column.transpose() * *weight;
            }
        }
        let wrench = normal.cholesky()?.solve(error);
        let step: Vec<f64> =
            jacobian.iter().zip(&weights).map(|(c, w)| w * c.dot(&wrench)).collect();
        let mut is_feasible = true;
        for (i, s) in step.iter().enumerate() {
            let [low, high] = bounds.limits[i];
            if (*s < 0.0 && x[i] <= low) || (*s > 0.0 && x[i] >= high) {
                weights[i] = 0.0;
                is_feasible = false;
            }
        }
        if is_feasible {
            return Some(step);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::planar_arm_tests::{chain, planar_arm};
    use super::*;
    use crate::geometry::Vec3;

    fn bounds(limit: f64) -> PositionBounds {
        let mut limits = vec![[-limit, limit]; 2];
        limits.extend([[0.0; 2]; 2]);
        PositionBounds { limits, weights: vec![1.0, 1.0, 0.0, 0.0] }
    }

    #[test]
    fn solutions_take_the_view_they_were_asked_for() {
        let chain = chain(&planar_arm());
        for truth in [[0.3, 0.5], [-1.2, 2.1], [1.5, -0.9]] {
            let target = chain.end_pose(&truth);
            let start = [truth[0] + 0.3, truth[1] - 0.2, 0.0, 0.0];
            let found =
                solve_inverse_kinematics(&chain, &target, &start, &bounds(3.0), 40).unwrap();
            let error = log(&(chain.end_pose(&found).inverse() * target)).norm();
            assert!(error < TWIST_TOLERANCE, "{truth:?}: {error}");
            // A planar arm with a given direction of its end has one solution.
            assert!((found[0] - truth[0]).abs() < 1e-6 && (found[1] - truth[1]).abs() < 1e-6);
            assert_eq!(found[2..], [0.0, 0.0]);
        }
    }

    #[test]
    fn limits_and_reach_are_respected() {
        let chain = chain(&planar_arm());
        let target = chain.end_pose(&[0.3, 1.5]);
        let start = [0.0, 0.0, 0.0, 0.0];
        assert!(solve_inverse_kinematics(&chain, &target, &start, &bounds(1.6), 60).is_some());
        assert!(solve_inverse_kinematics(&chain, &target, &start, &bounds(1.4), 60).is_none());
        let beyond = Pose::translation(0.8, 0.0, 0.0);
        assert!(solve_inverse_kinematics(&chain, &beyond, &start, &bounds(3.0), 60).is_none());
    }

    #[test]
    fn far_from_limits_the_step_is_that_of_damped_least_squares() {
        let chain = chain(&planar_arm());
        let x = [0.3, 0.5, 0.0, 0.0];
        let mut jacobian = Vec::new();
        let view = chain.view_with_jacobian(&x, &mut jacobian);
        let error = log(&(view.inverse() * (view * Pose::from(Vec3::new(0.01, 0.02, -0.01)))));
        let mut bounds = bounds(3.0);
        bounds.weights[1] = 0.25;
        let step = solve_damped_step(&jacobian, &error, &x, &bounds).unwrap();
        // The step minimises |J s - e|^2 + damping s' W^-1 s, whose gradient is zero.
        let damping = DAMPING_RATIO * error.norm_squared() + MIN_DAMPING;
        let residual = jacobian.iter().zip(&step).map(|(c, s)| c * *s).sum::<Twist>() - error;
        for i in 0..2 {
            let gradient = jacobian[i].dot(&residual) + damping * step[i] / bounds.weights[i];
            assert!(gradient.abs() < 1e-9, "{gradient}");
        }
        assert_eq!(step[2..], [0.0, 0.0]);
    }

    #[test]
    fn a_position_at_its_limit_does_not_leave_it() {
        let chain = chain(&planar_arm());
        let mut bounds = bounds(3.0);
        bounds.limits[0] = [-3.0, 0.3];
        let x = [0.3, 0.5, 0.0, 0.0];
        let mut jacobian = Vec::new();
        let view = chain.view_with_jacobian(&x, &mut jacobian);
        let error = log(&(view.inverse() * chain.end_pose(&[0.4, 0.5])));
        let step = solve_damped_step(&jacobian, &error, &x, &bounds).unwrap();
        assert_eq!(step[0], 0.0);
        assert!(step[1] > 0.0, "{step:?}");
    }
}
