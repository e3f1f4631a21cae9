//! Simulated robot and sensor behind the topics of real ones.
//!
//! Takes trajectories (`follow_joint_trajectory`) and scans (`trigger_scan`), and publishes `points`,
//! `joint_states`, transforms, `robot_description` and `/clock`. Time goes on only while robot or sensor act, so a
//! run does not depend on the machine's speed. What the transforms say is not quite where the sensor is.

mod machine;
mod motion;
mod outputs;
mod params;

pub use params::{DriverParams, Params, Setup};

use anyhow::Result;
use machine::Machine;
use puffer_msgs::control_msgs::action::{FollowJointTrajectory, FollowJointTrajectoryResult};
use puffer_msgs::srv::{LoadObject, LoadObjectRequest, LoadObjectResponse};
use puffer_msgs::std_srvs::srv::{Trigger, TriggerResponse};
use puffer_shell::{Goal, Node, Outcome, RosArgs, Stop};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Mutex;

/// The present is published this often while nothing moves, on the clock on the wall.
const HEARTBEAT: Duration = Duration::from_millis(250);

/// Runs the driver until `stop`.
///
/// # Errors
/// Parameters that do not fit, an object that cannot be simulated, or no network.
pub async fn run(args: RosArgs, stop: Stop) -> Result<()> {
    let node: Node<Params> = Node::start("mock_driver", args, stop.clone()).await?;
    let machine = Arc::new(Mutex::new(Machine::new(&node)?));
    serve_motion(&node, &machine)?;
    serve_scans(&node, &machine)?;
    serve_objects(&node, &machine)?;
    tracing::info!(
        "ready: {} before {}",
        node.params().driver.object,
        node.params().driver.setup.name()
    );
    while stop.or(tokio::time::sleep(HEARTBEAT)).await.is_some() {
        // While it moves it ticks by itself.
        if let Ok(machine) = machine.try_lock() {
            machine.tick()?;
        }
    }
    machine.lock().await.write_seen()
}

fn serve_motion(node: &Node<Params>, machine: &Arc<Mutex<Machine>>) -> Result<()> {
    let machine = Arc::clone(machine);
    node.action_server::<FollowJointTrajectory, _, _, _>(
        "follow_joint_trajectory",
        |_| Ok(()),
        move |goal: Goal<FollowJointTrajectory>| {
            let machine = Arc::clone(&machine);
            async move {
                let Ok(mut machine) = machine.try_lock() else {
                    return refused(
                        FollowJointTrajectoryResult::INVALID_GOAL,
                        "the robot is busy".into(),
                    );
                };
                let way = match machine.plan(goal.request()) {
                    Ok(way) => way,
                    Err(refusal) => return refused(refusal.code, refusal.text),
                };
                match machine.follow(&way, || goal.is_cancelled()).await {
                    Ok(true) => Outcome::Succeeded(FollowJointTrajectoryResult::default()),
                    Ok(false) => Outcome::Canceled(FollowJointTrajectoryResult {
                        error_string: "stopped on request".into(),
                        ..Default::default()
                    }),
                    Err(error) => {
                        refused(FollowJointTrajectoryResult::INVALID_GOAL, format!("{error:#}"))
                    }
                }
            }
        },
    )
}

fn refused(error_code: i32, error_string: String) -> Outcome<FollowJointTrajectoryResult> {
    tracing::warn!("trajectory refused: {error_string}");
    Outcome::Aborted(FollowJointTrajectoryResult { error_code, error_string })
}

fn serve_scans(node: &Node<Params>, machine: &Arc<Mutex<Machine>>) -> Result<()> {
    let machine = Arc::clone(machine);
    node.serve::<Trigger, _, _>("trigger_scan", move |_| {
        let machine = Arc::clone(&machine);
        async move {
            let Ok(mut machine) = machine.try_lock() else {
                return TriggerResponse { success: false, message: "the robot is moving".into() };
            };
            match machine.scan().await {
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

fn serve_objects(node: &Node<Params>, machine: &Arc<Mutex<Machine>>) -> Result<()> {
    let machine = Arc::clone(machine);
    node.serve::<LoadObject, _, _>("~/load_object", move |request: LoadObjectRequest| {
        let machine = Arc::clone(&machine);
        async move {
            let Ok(mut machine) = machine.try_lock() else {
                let message = "the robot is moving".into();
                return LoadObjectResponse { success: false, error_code: 1, message };
            };
            match tokio::task::block_in_place(|| machine.load(&request.object)) {
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
