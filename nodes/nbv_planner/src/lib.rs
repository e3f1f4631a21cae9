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
                    markers.show_space(desk.space(), node.now());
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
            let mut desk = desk.lock().await;
            let since = Instant::now();
            let planned = desk
                .aim(&request)
                .and_then(|aim| tokio::task::block_in_place(|| desk.plan(&request.start, aim)));
            match planned {
                Ok(planned) => {
                    markers.show_space(desk.space(), node.now());
                    markers.show_plan(&planned.plan, node.now());
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
    let scans = request.scans as usize;
    loop {
        let (fault, missing, without_poses, there) = {
            let desk = desk.lock().await;
            let missing = desk.missing(scans, request.revision);
            (desk.fault(), missing, desk.missing(scans, 0), desk.scans())
        };
        if let Some(fault) = fault {
            return Err(Box::new(failed(PlanViewResponse::NO_ROBOT, fault)));
        }
        let Some(missing) = missing else { return Ok(()) };
        if since.elapsed() > deadline {
            let code = match (there < scans, without_poses) {
                (false, Some(_)) => PlanViewResponse::NO_ROBOT,
                _ => PlanViewResponse::SCANS_MISSING,
            };
            let text = format!("{missing} within {:.0} s", deadline.as_secs_f64());
            return Err(Box::new(failed(code, text)));
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
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
