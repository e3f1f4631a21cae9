//! Runs the modelling loop: the only node that knows the order of things.
//!
//! The action `model_object` plans a view, moves, scans and waits for the verdict until no view is left, then has all
//! poses refined, the scans combined and the mesh made. `modelling_status` tells where it stands; `~/pause`,
//! `~/resume` and the action's cancel steer it. `~/finish` does the last three steps alone. The order itself is
//! [`puffer_core::session`].

mod busy;
mod finish;
mod goal;
mod inbox;
mod journal;
mod params;
mod partners;
mod runner;

pub use params::{ModellerParams, Noise, Params};

use anyhow::Result;
use busy::{Busy, Claim};
use goal::Modeller;
use inbox::Inbox;
use partners::Partners;
use puffer_core::session::Event;
use puffer_msgs::action::{ModelObject, ModelObjectGoal};
use puffer_msgs::msg::RegisteredScan;
use puffer_msgs::std_srvs::srv::{Trigger, TriggerResponse};
use puffer_shell::bulk::{BulkSubscription, Delivery};
use puffer_shell::{Goal, Node, Profile, RosArgs, Stop};
use std::sync::{Arc, Mutex, PoisonError};

/// Runs the modeller until `stop`.
///
/// # Errors
/// Parameters that do not fit, or no network.
pub async fn run(args: RosArgs, stop: Stop) -> Result<()> {
    let node: Node<Params> = Node::start("modeller", args, stop.clone()).await?;
    let scans: BulkSubscription<RegisteredScan> =
        node.bulk_subscribe("registered_scan", Delivery::Every)?;
    let modeller = Arc::new(Modeller {
        partners: Partners::new(&node)?,
        inbox: Arc::new(Inbox::default()),
        status: node.publisher("modelling_status", Profile::Standard)?,
        controls: Mutex::new(None),
        busy: Busy::default(),
        node: node.clone(),
    });
    serve_goals(&node, &modeller)?;
    finish::serve(&node, &modeller)?;
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
    // A running session writes its report before the node goes.
    while modeller.busy.is_claimed() {
        tokio::time::sleep(std::time::Duration::from_millis(20)).await;
    }
    Ok(())
}

fn serve_goals(node: &Node<Params>, modeller: &Arc<Modeller>) -> Result<()> {
    let modeller = Arc::clone(modeller);
    let busy = modeller.busy.clone();
    // From the acceptance of a goal until its work takes it over.
    let claimed: Arc<Mutex<Option<Claim>>> = Arc::default();
    let taken = Arc::clone(&claimed);
    node.action_server::<ModelObject, _, _, _>(
        "model_object",
        move |goal: &ModelObjectGoal| {
            goal::check(goal)?;
            let claim = busy.claim().ok_or("another object is being modelled")?;
            *claimed.lock().unwrap_or_else(PoisonError::into_inner) = Some(claim);
            Ok(())
        },
        move |goal: Goal<ModelObject>| {
            let modeller = Arc::clone(&modeller);
            let claim = taken.lock().unwrap_or_else(PoisonError::into_inner).take();
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
