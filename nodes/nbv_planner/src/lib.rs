//! The view planner as a node: registered scans and the robot to the next best view.
//!
//! Takes `registered_scan`, `registered_poses`, `joint_states` and `robot_description`; answers
//! `~/plan_view` with a view, the motion to it, and the candidates that were considered. The space
//! and the candidates are published as the markers `~/voxels` and `~/candidates`. All planning is
//! done by [`Planner`].

mod inputs;
mod markers;
mod params;
mod response;

pub use params::Params;

use anyhow::Result;
use markers::Markers;
use puffer_core::geometry::Aabb;
use puffer_core::planner::{JointPositions, PlanRequest, Planner, Readiness};
use puffer_msgs::msg::{RegisteredPoses, RegisteredScan};
use puffer_msgs::sensor_msgs::msg::JointState;
use puffer_msgs::srv::{PlanView, PlanViewRequest, PlanViewResponse};
use puffer_msgs::std_msgs::msg::{Header, String as Text};
use puffer_msgs::std_srvs::srv::{Trigger, TriggerResponse};
use puffer_ros::large_data::{Delivery, LargeDataSubscription};
use puffer_ros::{Node, QosProfile, RosArgs, Shared, Stop, Subscription};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long a plan waits for joint states that say that the robot is where it was sent to: they
/// follow the end of a motion within a period of the controller.
const MAX_REST_WAIT: Duration = Duration::from_secs(2);

/// Runs the planner until `stop`.
///
/// # Errors
/// Parameters that do not fit, or no network.
pub async fn run(args: RosArgs, stop: Stop) -> Result<()> {
    let node: Node<Params> = Node::start("nbv_planner", args, stop.clone()).await?;
    let scans: LargeDataSubscription<RegisteredScan> =
        node.large_data_subscribe("registered_scan", Delivery::Every)?;
    let poses: LargeDataSubscription<RegisteredPoses> =
        node.large_data_subscribe("registered_poses", Delivery::Newest)?;
    let mut joints: Subscription<JointState> =
        node.subscribe("joint_states", QosProfile::Standard)?;
    let mut descriptions: Subscription<Text> =
        node.subscribe("robot_description", QosProfile::LatchedSub)?;
    let Params { planner: params, view } = node.params();
    let region = params.region();
    let planner = Shared::new(Planner::new(params, view)?);
    let markers = Arc::new(Markers::new(&node)?);
    serve_plans(&node, &planner, &markers, region)?;
    serve_reset(&node, &planner)?;
    tracing::info!("ready");
    loop {
        let next = async {
            tokio::select! {
                scan = scans.next() => {
                    let scan = scan?;
                    let mut planner = planner.lock().await;
                    tokio::task::block_in_place(|| take_scan(&mut planner, &scan))?;
                    markers.show_space(planner.space(), header(&node, &planner));
                    Ok(())
                }
                poses = poses.next() => take_poses(&mut *planner.lock().await, &poses?),
                Some(state) = joints.next() => {
                    planner.lock().await.on_joint_state(&inputs::joint_positions(&state));
                    Ok(())
                }
                Some(text) = descriptions.next() => {
                    let mut planner = planner.lock().await;
                    let taken =
                        tokio::task::block_in_place(|| planner.on_robot_description(&text.data));
                    Ok(taken?)
                }
            }
        };
        match stop.or(next).await {
            None => return Ok(()),
            Some(Ok(())) => {}
            Some(Err(error)) => tracing::error!("{error:#}"),
        }
    }
}

/// Gives the planner a scan.
fn take_scan(planner: &mut Planner, message: &RegisteredScan) -> Result<()> {
    Ok(planner.on_scan(inputs::scan_update(message)?)?)
}

/// Gives the planner corrected poses.
fn take_poses(planner: &mut Planner, message: &RegisteredPoses) -> Result<()> {
    planner.on_corrected_poses(message.revision, &inputs::pose_updates(message)?);
    Ok(())
}

/// The header of what is published of the space, now: its frame is that of the scans.
fn header(node: &Node<Params>, planner: &Planner) -> Header {
    Header { stamp: node.now().into(), frame_id: planner.frame().to_owned() }
}

/// Serves `~/plan_view`; `configured` is the region of interest where a request names none.
fn serve_plans(
    node: &Node<Params>,
    planner: &Shared<Planner>,
    markers: &Arc<Markers>,
    configured: Aabb,
) -> Result<()> {
    let (shared, planner, markers) = (node.clone(), planner.clone(), Arc::clone(markers));
    node.serve::<PlanView, _, _>("~/plan_view", move |request: PlanViewRequest| {
        let (node, planner, markers) = (shared.clone(), planner.clone(), Arc::clone(&markers));
        async move {
            let request = match inputs::plan_request(&request, &configured) {
                Ok(request) => request,
                Err(error) => return failed(PlanViewResponse::FAILED, format!("{error:#}")),
            };
            let deadline = Duration::from_secs_f64(node.params().planner.input_deadline);
            if let Err(response) = wait_for_inputs(&planner, &request, deadline).await {
                return *response;
            }
            if let Some(goal) = &request.sent_to {
                wait_for_rest(&planner, goal).await;
            }
            plan(&node, &mut *planner.lock().await, &markers, &request)
        }
    })
}

/// Answers a request whose inputs have arrived.
fn plan(
    node: &Node<Params>,
    planner: &mut Planner,
    markers: &Markers,
    request: &PlanRequest,
) -> PlanViewResponse {
    let since = Instant::now();
    let result = match tokio::task::block_in_place(|| planner.plan(request)) {
        Ok(result) => result,
        Err(error) => return failed(PlanViewResponse::FAILED, format!("{error:#}")),
    };
    markers.show_space(planner.space(), header(node, planner));
    markers.show_plan(&result.plan, &header(node, planner));
    let response = response::from_result(&result, &planner.joint_names());
    tracing::info!(
        "{} in {:.2} s: gain {:.0}, coverage {:.1} %{}",
        response.message,
        since.elapsed().as_secs_f64(),
        response.expected_gain,
        response.coverage * 100.0,
        if response.done { ", done" } else { "" }
    );
    node.diagnostics().set("coverage", response.coverage);
    response
}

/// Waits until the inputs of a request have arrived.
async fn wait_for_inputs(
    planner: &Shared<Planner>,
    request: &PlanRequest,
    deadline: Duration,
) -> std::result::Result<(), Box<PlanViewResponse>> {
    let waited = planner.wait_until(deadline, |planner| match planner.readiness(request) {
        Readiness::Ready => Ok(None),
        // No wait mends that.
        Readiness::RobotUnusable(error) => Ok(Some(error)),
        Readiness::ScansMissing(missing) => Err((PlanViewResponse::SCANS_MISSING, missing)),
        Readiness::RobotMissing(missing) => Err((PlanViewResponse::NO_ROBOT, missing)),
    });
    match waited.await {
        Ok(None) => Ok(()),
        Ok(Some(error)) => Err(Box::new(failed(PlanViewResponse::NO_ROBOT, error))),
        Err((code, missing)) => {
            let text = format!("{missing} within {:.0} s", deadline.as_secs_f64());
            Err(Box::new(failed(code, text)))
        }
    }
}

/// Waits a little for joint states that say that the robot is at `goal`.
async fn wait_for_rest(planner: &Shared<Planner>, goal: &JointPositions) {
    let at_rest = planner.wait_until(MAX_REST_WAIT, |planner| {
        if planner.is_at(goal) {
            Ok(())
        } else {
            Err("the robot does not stand where it was sent to")
        }
    });
    if let Err(missing) = at_rest.await {
        tracing::warn!("{missing}: the way starts from joint_states");
    }
}

/// The response to a request that cannot be answered; it is logged as an error.
fn failed(error_code: u16, message: String) -> PlanViewResponse {
    tracing::error!("no plan: {message}");
    PlanViewResponse { success: false, error_code, message, ..PlanViewResponse::default() }
}

/// Serves `~/reset`, which forgets all scans.
fn serve_reset(node: &Node<Params>, planner: &Shared<Planner>) -> Result<()> {
    let planner = planner.clone();
    node.serve::<Trigger, _, _>("~/reset", move |_| {
        let planner = planner.clone();
        async move {
            let mut planner = planner.lock().await;
            let message = format!("{} scans forgotten", planner.scan_count());
            match tokio::task::block_in_place(|| planner.reset()) {
                Ok(()) => TriggerResponse { success: true, message },
                Err(error) => TriggerResponse { success: false, message: format!("{error:#}") },
            }
        }
    })
}
