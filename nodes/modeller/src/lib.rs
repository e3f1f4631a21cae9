//! Runs the modelling loop: the only node that knows in which order the others work.
//!
//! The action `model_object` plans a view, moves, scans and waits for the verdict on the scan until
//! no view is left; then it has all poses refined, the scans combined and the mesh made. The topic
//! `modelling_status` has the state of the session; `~/pause`, `~/resume` and cancelling the action
//! steer it. `~/finish` does the last three steps alone. The order itself is defined in
//! [`puffer_core::session`].

mod busy;
mod finish_service;
mod goal;
mod journal;
#[cfg(test)]
mod journal_tests;
mod node_clients;
mod node_services;
mod params;
mod report;
mod runner;
#[cfg(test)]
mod runner_tests;
mod scan_inbox;

pub use params::{ModellerParams, Params, SensorChoice};

use anyhow::Result;
use busy::{Busy, Claim};
use goal::Modeller;
use node_clients::NodeClients;
use puffer_core::session::Event;
use puffer_msgs::action::{ModelObject, ModelObjectGoal};
use puffer_msgs::msg::RegisteredScan;
use puffer_msgs::std_srvs::srv::{Trigger, TriggerResponse};
use puffer_ros::large_data::{Delivery, LargeDataSubscription};
use puffer_ros::{Goal, Node, QosProfile, RosArgs, Stop};
use scan_inbox::ScanInbox;
use std::sync::{Arc, Mutex, PoisonError};

/// Runs the modeller until `stop`.
///
/// # Errors
/// Parameters that do not fit, or no network.
pub async fn run(args: RosArgs, stop: Stop) -> Result<()> {
    let node: Node<Params> = Node::start("modeller", args, stop.clone()).await?;
    let scans: LargeDataSubscription<RegisteredScan> =
        node.large_data_subscribe("registered_scan", Delivery::Every)?;
    let modeller = Arc::new(Modeller {
        clients: NodeClients::new(&node)?,
        inbox: Arc::new(ScanInbox::default()),
        status: node.publisher("modelling_status", QosProfile::Standard)?,
        controls: Mutex::new(None),
        busy: Busy::default(),
        node: node.clone(),
    });
    serve_goals(&node, &modeller)?;
    finish_service::serve(&node, &modeller)?;
    serve_control(&node, &modeller, "~/pause", Event::Pause)?;
    serve_control(&node, &modeller, "~/resume", Event::Resume)?;
    tracing::info!("ready");
    loop {
        match stop.or(scans.next()).await {
            None => break,
            Some(Ok(scan)) => modeller.inbox.put(scan),
            Some(Err(error)) => tracing::warn!("{error}"),
        }
    }
    // A running session writes its report before the node ends.
    modeller.busy.released().await;
    Ok(())
}

fn serve_goals(node: &Node<Params>, modeller: &Arc<Modeller>) -> Result<()> {
    let modeller = Arc::clone(modeller);
    let busy = modeller.busy.clone();
    // Holds the claim from the acceptance of a goal until the work on it begins.
    let accepted: Arc<Mutex<Option<Claim>>> = Arc::default();
    let begun = Arc::clone(&accepted);
    node.action_server::<ModelObject, _, _, _>(
        "model_object",
        move |goal: &ModelObjectGoal| {
            goal::check_goal(goal)?;
            let claim = busy.claim().ok_or("another object is being modelled")?;
            *accepted.lock().unwrap_or_else(PoisonError::into_inner) = Some(claim);
            Ok(())
        },
        move |goal: Goal<ModelObject>| {
            let modeller = Arc::clone(&modeller);
            let claim = begun.lock().unwrap_or_else(PoisonError::into_inner).take();
            async move {
                let _claim = claim;
                modeller.model(goal).await
            }
        },
    )
}

fn serve_control(
    node: &Node<Params>,
    modeller: &Arc<Modeller>,
    name: &str,
    event: Event,
) -> Result<()> {
    let modeller = Arc::clone(modeller);
    node.serve::<Trigger, _, _>(name, move |_| {
        let success = modeller.control(event.clone());
        let message =
            if success { String::new() } else { "no object is being modelled".to_owned() };
        async move { TriggerResponse { success, message } }
    })
}
