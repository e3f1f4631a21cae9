//! The checks that a trajectory controller makes of its goals.

use puffer_core::robot::{RobotModel, Trajectory};
use puffer_msgs::control_msgs::action::{FollowJointTrajectoryGoal, FollowJointTrajectoryResult};
use puffer_msgs::trajectory_msgs::msg::JointTrajectoryPoint;

/// Largest distance of the first point from the present joint positions, radians or metres.
const START_TOLERANCE: f64 = 0.02;
/// Largest speed that may be asked of a joint, as a multiple of its limit; it allows for the
/// rounding of the times.
const MAX_SPEED_RATIO: f64 = 1.05;

/// Why a goal is rejected: an error code of FollowJointTrajectory, and a text.
#[derive(Debug)]
pub(crate) struct GoalRejection {
    pub code: i32,
    pub text: String,
}

/// The motion of all joints that a goal asks for, from the present joint positions `q`. Joints that
/// it does not name do not move.
///
/// # Errors
/// The reason why the goal is rejected.
pub(crate) fn check_goal(
    goal: &FollowJointTrajectoryGoal,
    robot: &RobotModel,
    q: &[f64],
) -> Result<Trajectory, GoalRejection> {
    let names = &goal.trajectory.joint_names;
    let indices = joint_indices(names, robot)?;
    if goal.trajectory.points.is_empty() {
        return Err(GoalRejection::invalid("the trajectory has no points".into()));
    }
    let mut trajectory = Trajectory { positions: vec![q.to_vec()], times: vec![0.0] };
    for (index, point) in goal.trajectory.points.iter().enumerate() {
        let time = point_time(point);
        let next = point_positions(point, &indices, q)
            .map_err(|e| GoalRejection::invalid(format!("point {index}: {e}")))?;
        if let Some(joint) = robot.joint_beyond_limits(&next) {
            let [low, high] = joint.limits;
            let text =
                format!("point {index}: {} leaves its limits {low:.3} to {high:.3}", joint.name);
            return Err(GoalRejection::invalid(text));
        }
        let before = trajectory.duration();
        if index == 0 && time <= 0.0 {
            let off = next.iter().zip(q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            if off > START_TOLERANCE {
                let code = FollowJointTrajectoryResult::PATH_TOLERANCE_VIOLATED;
                let text = format!("it starts {off:.3} rad (or m) from where the robot stands");
                return Err(GoalRejection { code, text });
            }
            continue;
        }
        if time <= before {
            return Err(GoalRejection::invalid(format!(
                "point {index}: its time {time} s is not after {before} s"
            )));
        }
        let last = trajectory.positions.last().map_or(q, Vec::as_slice);
        let needed = robot.min_travel_time(last, &next);
        if needed > MAX_SPEED_RATIO * (time - before) {
            let text = format!(
                "point {index}: the joints need {needed:.3} s for a leg of {:.3} s",
                time - before
            );
            return Err(GoalRejection::invalid(text));
        }
        trajectory.positions.push(next);
        trajectory.times.push(time);
    }
    Ok(trajectory)
}

impl GoalRejection {
    fn invalid(text: String) -> GoalRejection {
        GoalRejection { code: FollowJointTrajectoryResult::INVALID_GOAL, text }
    }
}

/// Index of each named joint.
fn joint_indices(names: &[String], robot: &RobotModel) -> Result<Vec<usize>, GoalRejection> {
    let known: Vec<&str> = robot.joints().iter().map(|joint| joint.name.as_str()).collect();
    names
        .iter()
        .map(|name| {
            known.iter().position(|joint| joint == name).ok_or_else(|| GoalRejection {
                code: FollowJointTrajectoryResult::INVALID_JOINTS,
                text: format!("there is no joint {name}; there are {}", known.join(", ")),
            })
        })
        .collect()
}

/// The positions of all joints at a point of a goal; `indices` are those of the goal's joints.
fn point_positions(
    point: &JointTrajectoryPoint,
    indices: &[usize],
    q: &[f64],
) -> Result<Vec<f64>, String> {
    if point.positions.len() != indices.len() {
        return Err(format!("{} positions for {} joints", point.positions.len(), indices.len()));
    }
    let mut next = q.to_vec();
    for (&index, &value) in indices.iter().zip(&point.positions) {
        if !value.is_finite() {
            return Err("a position is not finite".into());
        }
        next[index] = value;
    }
    Ok(next)
}

/// Time of a point from the start, seconds.
fn point_time(point: &JointTrajectoryPoint) -> f64 {
    f64::from(point.time_from_start.sec) + f64::from(point.time_from_start.nanosec) * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_core::robot::{home_configuration, setup_urdf};
    use puffer_msgs::builtin_interfaces::msg::Duration;

    fn goal(points: &[(i32, f64)]) -> FollowJointTrajectoryGoal {
        let mut goal = FollowJointTrajectoryGoal::default();
        goal.trajectory.joint_names = vec!["joint_a1".into()];
        goal.trajectory.points = points
            .iter()
            .map(|&(sec, position)| JointTrajectoryPoint {
                positions: vec![position],
                time_from_start: Duration { sec, nanosec: 0 },
                ..Default::default()
            })
            .collect();
        goal
    }

    #[test]
    fn a_goal_moves_the_joints_it_names_and_wrong_ones_say_why() {
        let robot = RobotModel::from_urdf(setup_urdf("kr16_laser").unwrap()).unwrap();
        let q = home_configuration("kr16_laser").unwrap();
        let good = check_goal(&goal(&[(0, q[0]), (2, q[0] + 0.5)]), &robot, &q).unwrap();
        assert_eq!((good.duration(), good.positions.len()), (2.0, 2));
        assert_eq!(good.positions[1][1..], q[1..]);
        let mut other = goal(&[(1, 0.0)]);
        other.trajectory.joint_names[0] = "elbow".into();
        let mut short = goal(&[(1, 0.0)]);
        short.trajectory.points[0].positions.clear();
        let mut infinite = goal(&[(1, 0.0)]);
        infinite.trajectory.points[0].positions[0] = f64::INFINITY;
        let invalid = FollowJointTrajectoryResult::INVALID_GOAL;
        let far = FollowJointTrajectoryResult::PATH_TOLERANCE_VIOLATED;
        let unknown = FollowJointTrajectoryResult::INVALID_JOINTS;
        for (goal, code, text) in [
            (goal(&[]), invalid, "no points"),
            (goal(&[(2, 9.0)]), invalid, "joint_a1 leaves its limits"),
            (goal(&[(1, 3.0)]), invalid, "the joints need"),
            (goal(&[(2, 0.1), (2, 0.2)]), invalid, "not after 2 s"),
            (goal(&[(0, 1.0)]), far, "from where the robot stands"),
            (other, unknown, "no joint elbow; there are joint_a1"),
            (short, invalid, "0 positions for 1 joints"),
            (infinite, invalid, "a position is not finite"),
        ] {
            let rejection = check_goal(&goal, &robot, &q).unwrap_err();
            assert_eq!(rejection.code, code, "{text}");
            assert!(rejection.text.contains(text), "{}", rejection.text);
        }
    }
}
