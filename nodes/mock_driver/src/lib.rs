//! Simulated robot and sensor behind the topics of real ones.
//!
//! Offers motions (`follow_joint_trajectory`) and scans (`trigger_scan`), and publishes `points`,
//! `joint_states`, transforms, `robot_description` and `/clock`. Time goes on only while the robot
//! or the sensor acts, so a run does not depend on the speed of the computer. The true pose of the
//! sensor differs a little from what the transforms say, as with a real robot.

mod params;
mod robot_publishers;
mod simulated_robot;
mod trajectory_goal;

pub use params::{DriverParams, Params, Setup};

use anyhow::Result;
use puffer_msgs::control_msgs::action::{FollowJointTrajectory, FollowJointTrajectoryResult};
use puffer_msgs::srv::{LoadObject, LoadObjectRequest, LoadObjectResponse};
use puffer_msgs::std_srvs::srv::{Trigger, TriggerResponse};
use puffer_ros::{Goal, Node, Outcome, RosArgs, Stop};
use simulated_robot::{MotionEnd, SimulatedRobot};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Mutex;

/// Period in which the robot's state is published while nothing moves, wall clock.
const IDLE_PUBLISH_PERIOD: Duration = Duration::from_millis(250);

/// Runs the driver until `stop`.
///
/// # Errors
/// Parameters that do not fit, an object that cannot be simulated, or no network.
pub async fn run(args: RosArgs, stop: Stop) -> Result<()> {
    let node: Node<Params> = Node::start("mock_driver", args, stop.clone()).await?;
    let robot = Arc::new(Mutex::new(SimulatedRobot::new(&node)?));
    serve_motion(&node, &robot)?;
    serve_scans(&node, &robot)?;
    serve_objects(&node, &robot)?;
    tracing::info!(
        "ready: {} before {}",
        node.params().driver.object,
        node.params().driver.setup.name()
    );
    while stop.or(tokio::time::sleep(IDLE_PUBLISH_PERIOD)).await.is_some() {
        // While the robot moves it publishes its state itself.
        if let Ok(robot) = robot.try_lock() {
            robot.publish_state()?;
        }
    }
    robot.lock().await.write_seen_points()
}

fn serve_motion(node: &Node<Params>, robot: &Arc<Mutex<SimulatedRobot>>) -> Result<()> {
    let robot = Arc::clone(robot);
    node.action_server::<FollowJointTrajectory, _, _, _>(
        "follow_joint_trajectory",
        |_| Ok(()),
        move |goal: Goal<FollowJointTrajectory>| {
            let robot = Arc::clone(&robot);
            async move {
                let Ok(mut robot) = robot.try_lock() else {
                    return abort_goal(
                        FollowJointTrajectoryResult::INVALID_GOAL,
                        "the robot is busy".into(),
                    );
                };
                let trajectory = match robot.check_goal(goal.request()) {
                    Ok(trajectory) => trajectory,
                    Err(rejection) => return abort_goal(rejection.code, rejection.text),
                };
                match robot.follow(&trajectory, || goal.is_cancelled()).await {
                    Ok(MotionEnd::Completed) => {
                        Outcome::Succeeded(FollowJointTrajectoryResult::default())
                    }
                    Ok(MotionEnd::Stopped) => Outcome::Canceled(FollowJointTrajectoryResult {
                        error_string: "stopped on request".into(),
                        ..Default::default()
                    }),
                    Err(error) => {
                        abort_goal(FollowJointTrajectoryResult::INVALID_GOAL, format!("{error:#}"))
                    }
                }
            }
        },
    )
}

fn abort_goal(error_code: i32, error_string: String) -> Outcome<FollowJointTrajectoryResult> {
    tracing::warn!("trajectory refused: {error_string}");
    Outcome::Aborted(FollowJointTrajectoryResult { error_code, error_string })
}

fn serve_scans(node: &Node<Params>, robot: &Arc<Mutex<SimulatedRobot>>) -> Result<()> {
    let robot = Arc::clone(robot);
    node.serve::<Trigger, _, _>("trigger_scan", move |_| {
        let robot = Arc::clone(&robot);
        async move {
            let Ok(mut robot) = robot.try_lock() else {
                return TriggerResponse { success: false, message: "the robot is moving".into() };
            };
            match robot.scan().await {
                Ok(points) => {
                    TriggerResponse { success: true, message: format!("{points} points") }
                }
                Err(error) => {
                    tracing::warn!("no scan: {error:#}");
                    TriggerResponse { success: false, message: format!("{error:#}") }
                }
            }
        }
    })
}

fn serve_objects(node: &Node<Params>, robot: &Arc<Mutex<SimulatedRobot>>) -> Result<()> {
    let robot = Arc::clone(robot);
    node.serve::<LoadObject, _, _>("~/load_object", move |request: LoadObjectRequest| {
        let robot = Arc::clone(&robot);
        async move {
            let Ok(mut robot) = robot.try_lock() else {
                let message = "the robot is moving".into();
                return LoadObjectResponse { success: false, error_code: 1, message };
            };
            match tokio::task::block_in_place(|| robot.load_object(&request.object)) {
                Ok(()) => LoadObjectResponse { success: true, ..Default::default() },
                Err(error) => LoadObjectResponse {
                    success: false,
                    error_code: 2,
                    message: format!("{error:#}"),
                },
            }
        }
    })
}
