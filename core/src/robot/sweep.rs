//! The sensor's straight way along its y at constant orientation.

use super::chain::Chain;
use super::inverse::{Bounds, solve};
use super::motion::Space;
use super::timing::Trajectory;
use crate::geometry::{Pose, Vec3};

/// Speed of the sensor along a sweep, metres a second. Ours.
const SPEED: f64 = 0.06;
/// Iterations from one point of a sweep to the next.
const ITERATIONS: usize = 10;

/// The joint vectors along a sweep of `length` metres about `q`, from -length / 2 to +length / 2 along the sensor's
/// y in `2 * half_steps` steps, with `q` in the middle.
///
/// # Errors
/// What is in the way, in words.
pub(crate) fn swept(
    space: &Space,
    chain: &Chain,
    q: &[f64],
    length: f64,
    half_steps: usize,
) -> Result<Trajectory, String> {
    let half_steps = half_steps.max(1);
    let step = length / 2.0 / half_steps as f64;
    let mut back = half(space, chain, q, -step, half_steps)?;
    let forth = half(space, chain, q, step, half_steps)?;
    back.reverse();
    back.push(q.to_vec());
    back.extend(forth);
    let times = (0..back.len()).map(|i| i as f64 * step / SPEED).collect();
    Ok(Trajectory { positions: back, times })
}

/// The points of one half, from the middle outwards.
fn half(
    space: &Space,
    chain: &Chain,
    q: &[f64],
    step: f64,
    count: usize,
) -> Result<Vec<Vec<f64>>, String> {
    let mut x: Vec<f64> = chain.joints.iter().map(|&j| q[j]).chain([0.0, 0.0]).collect();
    let middle = chain.pose(&x);
    let bounds = bounds(space, chain);
    let mut points = Vec::with_capacity(count);
    let mut last = q.to_vec();
    for i in 1..=count {
        let target = middle * Pose::from(Vec3::y() * (step * i as f64));
        x = solve(chain, &target, &x, &bounds, ITERATIONS)
            .ok_or("the sweep leaves the reach or the joint limits")?;
        let mut next = last.clone();
        for (&joint, &value) in chain.joints.iter().zip(&x) {
            next[joint] = value;
        }
        // A joint that would have to turn faster than it can stands near a singularity.
        if space.robot.joint_time(&last, &next) > step.abs() / SPEED {
            return Err("the sweep passes a singularity".to_owned());
        }
        if let Some(pair) = space.too_close(&next).or_else(|| space.blocked(&last, &next)) {
            return Err(format!("the sweep brings {} together", space.describe(&pair)));
        }
        points.push(next.clone());
        last = next;
    }
    Ok(points)
}

fn bounds(space: &Space, chain: &Chain) -> Bounds {
    let mut limits: Vec<[f64; 2]> =
        chain.joints.iter().map(|&j| space.robot.joints[j].limits).collect();
    let mut weights = vec![1.0; limits.len()];
    limits.extend([[0.0; 2]; 2]);
    weights.extend([0.0; 2]);
    Bounds { limits, weights }
}
