//! The straight motion of the sensor along its y axis at constant orientation.

use super::inverse_kinematics::{PositionBounds, solve_inverse_kinematics};
use super::kinematic_chain::KinematicChain;
use super::planning_space::PlanningSpace;
use super::trajectory::Trajectory;
use crate::geometry::{Pose, Vec3};

/// Number of steps of a sweep to either side of its middle. The planner and the simulated driver
/// use the same, so that the driver does not refuse a sweep that was found possible.
pub(crate) const HALF_SWEEP_STEPS: usize = 12;
/// Speed of the sensor along a sweep, metres a second. Our choice; the thesis states none.
const SWEEP_SPEED: f64 = 0.06;
/// Iterations of the inverse kinematics from one point of a sweep to the next.
const MAX_ITERATIONS: usize = 10;

/// Plans a sweep of `length` metres about the joint positions `q`, from `-length / 2` to
/// `+length / 2` along the sensor's y axis, in `2 * half_steps` steps with `q` in the middle.
///
/// # Errors
/// A text that says what is in the way.
pub(crate) fn plan_sweep(
    space: &PlanningSpace,
    chain: &KinematicChain,
    q: &[f64],
    length: f64,
    half_steps: usize,
) -> Result<Trajectory, String> {
    let half_steps = half_steps.max(1);
    let step = length / 2.0 / half_steps as f64;
    let mut positions = plan_half_sweep(space, chain, q, -step, half_steps)?;
    let forward = plan_half_sweep(space, chain, q, step, half_steps)?;
    positions.reverse();
    positions.push(q.to_vec());
    positions.extend(forward);
    let times = (0..positions.len()).map(|i| i as f64 * step / SWEEP_SPEED).collect();
    Ok(Trajectory { positions, times })
}

/// The joint positions of one half of a sweep from the middle outwards, in `count` steps of `step`
/// metres (negative: towards -y).
fn plan_half_sweep(
    space: &PlanningSpace,
    chain: &KinematicChain,
    q: &[f64],
    step: f64,
    count: usize,
) -> Result<Vec<Vec<f64>>, String> {
    let mut x = chain.joint_positions(q);
    x.extend([0.0, 0.0]);
    let middle = chain.end_pose(&x);
    let bounds = sweep_bounds(space, chain);
    let mut points = Vec::with_capacity(count);
    let mut last = q.to_vec();
    for i in 1..=count {
        let target = middle * Pose::from(Vec3::y() * (step * i as f64));
        x = solve_inverse_kinematics(chain, &target, &x, &bounds, MAX_ITERATIONS)
            .ok_or("the sweep leaves the reach or the joint limits")?;
        let mut next = last.clone();
        for (&joint, &value) in chain.joints.iter().zip(&x) {
            next[joint] = value;
        }
        // Near a singularity a joint would have to turn faster than it can.
        if space.robot.min_travel_time(&last, &next) > step.abs() / SWEEP_SPEED {
            return Err("the sweep passes a singularity".to_owned());
        }
        if let Some(pair) =
            space.collision_at(&next).or_else(|| space.collision_between(&last, &next))
        {
            return Err(format!("the sweep brings {} together", space.describe_pair(&pair)));
        }
        points.push(next.clone());
        last = next;
    }
    Ok(points)
}

/// All joints are free within their limits; slide and roll are fixed.
fn sweep_bounds(space: &PlanningSpace, chain: &KinematicChain) -> PositionBounds {
    let mut limits: Vec<[f64; 2]> =
        chain.joints.iter().map(|&j| space.robot.joints[j].limits).collect();
    let mut weights = vec![1.0; limits.len()];
    limits.extend([[0.0; 2]; 2]);
    weights.extend([0.0; 2]);
    PositionBounds { limits, weights }
}

#[cfg(test)]
mod tests {
    use crate::geometry::{Pose, log};
    use crate::robot::{Obstacle, RobotModel, Workcell, home_configuration, setup_urdf};

    #[test]
    fn a_sweep_is_straight_of_constant_speed_and_refused_where_it_leaves_the_reach() {
        let robot = RobotModel::from_urdf(setup_urdf("kr16_laser").unwrap()).unwrap();
        let cell = Workcell::new(robot).unwrap();
        let home = home_configuration("kr16_laser").unwrap();
        let none = Obstacle::empty();
        let sweep = cell.plan_sweep(&home, 0.1, 5, &none, 0.0).unwrap().unwrap();
        assert_eq!((sweep.positions.len(), &sweep.positions[5]), (11, &home));
        let middle = cell.object_from_sensor(&home).unwrap();
        for (i, q) in sweep.positions.iter().enumerate() {
            let expected = middle * Pose::translation(0.0, 0.01 * (i as f64 - 5.0), 0.0);
            let actual = cell.object_from_sensor(q).unwrap();
            assert!(log(&(expected.inverse() * actual)).norm() < 1e-6);
            assert!((sweep.times[i] - 0.01 * i as f64 / super::SWEEP_SPEED).abs() < 1e-12);
        }
        let why = cell.plan_sweep(&home, 4.0, 60, &none, 0.0).unwrap().unwrap_err();
        assert!(why.contains("the sweep"), "{why}");
        assert!(cell.plan_sweep(&home[1..], 0.1, 5, &none, 0.0).is_err());
    }
}
