//! Registered scans and the robot to the next best view.
//!
//! Takes `registered_scan`, `registered_poses`, `joint_states` and `robot_description`; answers `~/plan_view` with a
//! view, the way there, and what was considered. Whoever watches gets `~/voxels` and `~/candidates` as markers.

mod answer;
mod desk;
mod markers;
mod params;

pub use params::{Params, PlannerParams, SensorChoice};

use anyhow::Result;
use desk::Desk;
use markers::Markers;
use puffer_msgs::msg::{RegisteredPoses, RegisteredScan};
use puffer_msgs::sensor_msgs::msg::JointState;
use puffer_msgs::srv::{PlanView, PlanViewRequest, PlanViewResponse};
use puffer_msgs::std_msgs::msg::String as Text;
use puffer_msgs::std_srvs::srv::{Trigger, TriggerResponse};
use puffer_shell::bulk::{BulkSubscription, Delivery};
use puffer_shell::{Node, Profile, RosArgs, Stop, Subscription};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::Mutex;

/// How often it is looked whether all is there that a plan needs.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// How long a plan waits for joint states that say that the robot stands where it was sent to: they follow the end of a
/// motion within a period of the controller.
const REST_DEADLINE: Duration = Duration::from_secs(2);

/// Runs the planner until `stop`.
///
/// # Errors
/// Parameters that do not fit, or no network.
pub async fn run(args: RosArgs, stop: Stop) -> Result<()> {
    let node: Node<Params> = Node::start("nbv_planner", args, stop.clone()).await?;
    let scans: BulkSubscription<RegisteredScan> =
        node.bulk_subscribe("registered_scan", Delivery::Every)?;
    let poses: BulkSubscription<RegisteredPoses> =
        node.bulk_subscribe("registered_poses", Delivery::Newest)?;
    let mut joints: Subscription<JointState> = node.subscribe("joint_states", Profile::Standard)?;
    let mut descriptions: Subscription<Text> =
        node.subscribe("robot_description", Profile::LatchedSub)?;
    let desk = Arc::new(Mutex::new(Desk::new(node.params())?));
    let markers = Arc::new(Markers::new(&node)?);
    serve_plans(&node, &desk, &markers)?;
    serve_reset(&node, &desk)?;
    tracing::info!("ready");
    loop {
        let next = async {
            tokio::select! {
                scan = scans.next() => {
                    let scan = scan?;
                    let mut desk = desk.lock().await;
                    tokio::task::block_in_place(|| desk.take(&scan))?;
                    markers.show_space(desk.space(), desk.header(node.now()));
                    Ok(())
                }
                poses = poses.next() => desk.lock().await.correct(&poses?),
                Some(state) = joints.next() => {
                    desk.lock().await.stand(&state);
                    Ok(())
                }
                Some(text) = descriptions.next() => {
                    let mut desk = desk.lock().await;
                    tokio::task::block_in_place(|| desk.describe(&text.data))
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

fn serve_plans(node: &Node<Params>, desk: &Arc<Mutex<Desk>>, markers: &Arc<Markers>) -> Result<()> {
    let (shared, desk, markers) = (node.clone(), Arc::clone(desk), Arc::clone(markers));
    node.serve::<PlanView, _, _>("~/plan_view", move |request: PlanViewRequest| {
        let (node, desk, markers) = (shared.clone(), Arc::clone(&desk), Arc::clone(&markers));
        async move {
            let deadline = Duration::from_secs_f64(node.params().planner.input_deadline);
            if let Err(response) = wait_for(&desk, &request, deadline).await {
                return *response;
            }
            wait_for_rest(&desk, &request.sent_to).await;
            let mut desk = desk.lock().await;
            let since = Instant::now();
            match tokio::task::block_in_place(|| desk.plan(&request)) {
                Ok(planned) => {
                    markers.show_space(desk.space(), desk.header(node.now()));
                    markers.show_plan(&planned.plan, &desk.header(node.now()));
                    let response = answer::response(&planned, &desk.joint_names());
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
                Err(error) => failed(PlanViewResponse::FAILED, format!("{error:#}")),
            }
        }
    })
}

/// Waits until all is there that a plan needs.
async fn wait_for(
    desk: &Mutex<Desk>,
    request: &PlanViewRequest,
    deadline: Duration,
) -> std::result::Result<(), Box<PlanViewResponse>> {
    let since = Instant::now();
    loop {
        let (fault, no_robot, no_scans) = {
            let desk = desk.lock().await;
            (desk.fault(), desk.missing_robot(), desk.missing_scans(request))
        };
        if let Some(fault) = fault {
            return Err(Box::new(failed(PlanViewResponse::NO_ROBOT, fault)));
        }
        let (code, missing) = match (no_robot, no_scans) {
            (None, None) => return Ok(()),
            (_, Some(missing)) => (PlanViewResponse::SCANS_MISSING, missing),
            (Some(missing), None) => (PlanViewResponse::NO_ROBOT, missing),
        };
        if since.elapsed() > deadline {
            let text = format!("{missing} within {:.0} s", deadline.as_secs_f64());
            return Err(Box::new(failed(code, text)));
        }
        tokio::time::sleep(LOOK_EVERY).await;
    }
}

/// Waits a little for joint states that say that the robot stands where it was sent to.
async fn wait_for_rest(desk: &Mutex<Desk>, sent_to: &JointState) {
    let since = Instant::now();
    while !sent_to.name.is_empty() && !desk.lock().await.stands_at(sent_to) {
        if since.elapsed() > REST_DEADLINE {
            tracing::warn!(
                "the robot does not stand where it was sent to: the way starts from joint_states"
            );
            return;
        }
        tokio::time::sleep(LOOK_EVERY).await;
    }
}

fn failed(error_code: u16, message: String) -> PlanViewResponse {
    tracing::error!("no plan: {message}");
    PlanViewResponse { success: false, error_code, message, ..PlanViewResponse::default() }
}

fn serve_reset(node: &Node<Params>, desk: &Arc<Mutex<Desk>>) -> Result<()> {
    let desk = Arc::clone(desk);
    node.serve::<Trigger, _, _>("~/reset", move |_| {
        let desk = Arc::clone(&desk);
        async move {
            let mut desk = desk.lock().await;
            let message = format!("{} scans forgotten", desk.scans());
            match tokio::task::block_in_place(|| desk.reset()) {
                Ok(()) => TriggerResponse { success: true, message },
                Err(error) => TriggerResponse { success: false, message: format!("{error:#}") },
            }
        }
    })
}
