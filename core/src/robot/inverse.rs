//! Inverse kinematics of a view by damped least squares (Buss 2004, Introduction to inverse kinematics with
//! Jacobian transpose, pseudoinverse and damped least squares methods, §5) with joint limits as active set.

use super::chain::Chain;
use crate::geometry::{Mat6, Pose, Twist, log};

/// A view is reached when its twist to the target is shorter (metres, radians).
const TOLERANCE: f64 = 1e-7;
/// Largest step of a joint in one iteration, radians or metres.
const MAX_STEP: f64 = 0.5;
/// Square of the damping per square of the error: strong far away, vanishing at the target.
const DAMPING: f64 = 0.05;
/// Iterations without a tenth less error after which the search is given up.
const PATIENCE: usize = 10;

/// What the search may do with each position.
#[derive(Clone, Debug)]
pub(crate) struct Bounds {
    /// Lowest and highest value.
    pub limits: Vec<[f64; 2]>,
    /// How willingly it moves; 0 keeps it.
    pub weights: Vec<f64>,
}

/// Positions near `x` that bring the view to `target`; none if the search does not get there.
pub(crate) fn solve(
    chain: &Chain,
    target: &Pose,
    x: &[f64],
    bounds: &Bounds,
    iterations: usize,
) -> Option<Vec<f64>> {
    let mut x = x.to_vec();
    let mut columns = Vec::new();
    let (mut best, mut since) = (f64::INFINITY, 0);
    for _ in 0..iterations {
        let error = log(&(chain.view(&x, &mut columns).inverse() * target));
        let size = error.norm();
        if size < TOLERANCE {
            return Some(x);
        }
        if size < 0.9 * best {
            (best, since) = (size, 0);
        } else {
            since += 1;
            if since > PATIENCE {
                return None;
            }
        }
        let step = step(&columns, &error, &x, bounds)?;
        let largest = step.iter().fold(0.0, |m: f64, s| m.max(s.abs()));
        let scale = (MAX_STEP / largest).min(1.0);
        for ((x, s), [low, high]) in x.iter_mut().zip(&step).zip(&bounds.limits) {
            *x = (*x + s * scale).clamp(*low, *high);
        }
    }
    None
}

/// The damped step; what stands at a limit and would leave it is kept, and the rest asked again.
fn step(columns: &[Twist], error: &Twist, x: &[f64], bounds: &Bounds) -> Option<Vec<f64>> {
    let mut weights = bounds.weights.clone();
    let damping = DAMPING * error.norm_squared() + 1e-10;
    loop {
        let mut normal = Mat6::identity() * damping;
        for (column, weight) in columns.iter().zip(&weights) {
            if *weight > 0.0 {
                normal += column * column.transpose() * *weight;
            }
        }
        let push = normal.cholesky()?.solve(error);
        let step: Vec<f64> = columns.iter().zip(&weights).map(|(c, w)| w * c.dot(&push)).collect();
        let mut kept = false;
        for (i, s) in step.iter().enumerate() {
            let [low, high] = bounds.limits[i];
            if (*s < 0.0 && x[i] <= low) || (*s > 0.0 && x[i] >= high) {
                weights[i] = 0.0;
                kept = true;
            }
        }
        if !kept {
            return Some(step);
        }
    }
}
