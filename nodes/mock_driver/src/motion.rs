//! Trajectories as a controller takes them.

use puffer_core::robot::{RobotModel, Trajectory};
use puffer_msgs::control_msgs::action::{FollowJointTrajectoryGoal, FollowJointTrajectoryResult};
use puffer_msgs::trajectory_msgs::msg::JointTrajectoryPoint;

/// How far the first point may lie from where the robot stands, radians or metres.
const START_TOLERANCE: f64 = 0.02;
/// How much faster than its limit a joint may be asked to move: rounding of the times, no more.
const SPEED_TOLERANCE: f64 = 1.05;

/// Why a goal is not taken: one of FollowJointTrajectory's codes, and a text.
#[derive(Debug)]
pub(crate) struct Refusal {
    pub code: i32,
    pub text: String,
}

/// The goal's motion of all joints, from where the robot stands at `q`; joints that it does not name stay.
pub(crate) fn checked(
    goal: &FollowJointTrajectoryGoal,
    robot: &RobotModel,
    q: &[f64],
) -> Result<Trajectory, Refusal> {
    let invalid = |text: String| Refusal { code: FollowJointTrajectoryResult::INVALID_GOAL, text };
    let names = &goal.trajectory.joint_names;
    let places = places(names, robot)?;
    if goal.trajectory.points.is_empty() {
        return Err(invalid("the trajectory has no points".into()));
    }
    let mut trajectory = Trajectory { positions: vec![q.to_vec()], times: vec![0.0] };
    for (index, point) in goal.trajectory.points.iter().enumerate() {
        let time = seconds(point);
        let next = placed(point, &places, q).map_err(|e| invalid(format!("point {index}: {e}")))?;
        if let Some(joint) = robot.beyond_limits(&next) {
            let [low, high] = joint.limits;
            let text =
                format!("point {index}: {} leaves its limits {low:.3} to {high:.3}", joint.name);
            return Err(invalid(text));
        }
        let before = trajectory.duration();
        if index == 0 && time <= 0.0 {
            let off = next.iter().zip(q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            if off > START_TOLERANCE {
                let code = FollowJointTrajectoryResult::PATH_TOLERANCE_VIOLATED;
                let text = format!("it starts {off:.3} rad (or m) from where the robot stands");
                return Err(Refusal { code, text });
            }
            continue;
        }
        if time <= before {
            return Err(invalid(format!(
                "point {index}: its time {time} s is not after {before} s"
            )));
        }
        let last = trajectory.positions.last().map_or(q, Vec::as_slice);
        let needed = robot.joint_time(last, &next);
        if needed > SPEED_TOLERANCE * (time - before) {
            let text = format!(
                "point {index}: the joints need {needed:.3} s for a leg of {:.3} s",
                time - before
            );
            return Err(invalid(text));
        }
        trajectory.positions.push(next);
        trajectory.times.push(time);
    }
    Ok(trajectory)
}

/// Index of each named joint.
fn places(names: &[String], robot: &RobotModel) -> Result<Vec<usize>, Refusal> {
    let place = |name: &String| {
        robot.joints().iter().position(|joint| joint.name == *name).ok_or_else(|| {
            let known: Vec<&str> = robot.joints().iter().map(|j| j.name.as_str()).collect();
            Refusal {
                code: FollowJointTrajectoryResult::INVALID_JOINTS,
                text: format!("there is no joint {name}; there are {}", known.join(", ")),
            }
        })
    };
    names.iter().map(place).collect()
}

fn placed(point: &JointTrajectoryPoint, places: &[usize], q: &[f64]) -> Result<Vec<f64>, String> {
    if point.positions.len() != places.len() {
        return Err(format!("{} positions for {} joints", point.positions.len(), places.len()));
    }
    let mut next = q.to_vec();
    for (&place, &value) in places.iter().zip(&point.positions) {
        if !value.is_finite() {
            return Err("a position is not finite".into());
        }
        next[place] = value;
    }
    Ok(next)
}

fn seconds(point: &JointTrajectoryPoint) -> f64 {
    f64::from(point.time_from_start.sec) + f64::from(point.time_from_start.nanosec) * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_core::robot::{description, home};
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
        let robot = RobotModel::from_urdf(description("kr16_laser").unwrap()).unwrap();
        let q = home("kr16_laser").unwrap();
        let good = checked(&goal(&[(0, q[0]), (2, q[0] + 0.5)]), &robot, &q).unwrap();
        assert_eq!((good.duration(), good.positions.len()), (2.0, 2));
        assert_eq!(good.positions[1][1..], q[1..]);
        let says = |goal: FollowJointTrajectoryGoal, code: i32, text: &str| {
            let refusal = checked(&goal, &robot, &q).unwrap_err();
            assert_eq!(refusal.code, code);
            assert!(refusal.text.contains(text), "{}", refusal.text);
        };
        let invalid = FollowJointTrajectoryResult::INVALID_GOAL;
        says(goal(&[]), invalid, "no points");
        says(goal(&[(2, 9.0)]), invalid, "joint_a1 leaves its limits");
        says(goal(&[(1, 3.0)]), invalid, "the joints need");
        says(goal(&[(2, 0.1), (2, 0.2)]), invalid, "not after 2 s");
        says(
            goal(&[(0, 1.0)]),
            FollowJointTrajectoryResult::PATH_TOLERANCE_VIOLATED,
            "from where the robot stands",
        );
        let mut other = goal(&[(1, 0.0)]);
        other.trajectory.joint_names[0] = "elbow".into();
        says(
            other,
            FollowJointTrajectoryResult::INVALID_JOINTS,
            "no joint elbow; there are joint_a1",
        );
        let mut short = goal(&[(1, 0.0)]);
        short.trajectory.points[0].positions.clear();
        says(short, invalid, "0 positions for 1 joints");
    }
}
