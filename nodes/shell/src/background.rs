//! What every node does beside its own work: `/rosout`, `/diagnostics`, `/clock`.

use crate::node::Core;
use crate::{Publisher, qos};
use anyhow::Result;
use puffer_msgs::diagnostic_msgs::msg::DiagnosticArray;
use puffer_msgs::rcl_interfaces::msg::Log;
use puffer_msgs::rosgraph_msgs::msg::Clock;
use rustdds::policy::Durability;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::mpsc::UnboundedReceiver;
use tokio::sync::watch;

/// rclcpp's /diagnostics are told at this period.
const DIAGNOSTICS_PERIOD: Duration = Duration::from_secs(1);

pub(crate) fn logs(core: &Core, mut lines: UnboundedReceiver<Log>) -> Result<()> {
    let rosout: Publisher<Log> =
        core.publisher_with("/rosout", &qos::events(Durability::TransientLocal))?;
    let stop = core.closing.clone();
    tokio::spawn(async move {
        while let Some(Some(line)) = stop.or(lines.recv()).await {
            // Nothing to tell it to: this is where messages go.
            let _ = rosout.publish(&line);
        }
    });
    Ok(())
}

pub(crate) fn diagnostics(core: &Arc<Core>) -> Result<()> {
    let publisher: Publisher<DiagnosticArray> =
        core.publisher_with("/diagnostics", &crate::Profile::Standard.policies())?;
    let (board, clock) = (core.diagnostics.clone(), core.clock.clone());
    let (name, stop) = (core.names.full(), core.closing.clone());
    tokio::spawn(async move {
        let mut period = tokio::time::interval(DIAGNOSTICS_PERIOD);
        period.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
        while stop.or(period.tick()).await.is_some() {
            let mut message = board.message(&name);
            message.header.stamp = clock.now().into();
            if let Err(error) = publisher.publish(&message) {
                tracing::debug!(node = %name, "diagnostics lost: {error}");
            }
        }
    });
    Ok(())
}

/// Follows `/clock` from the first time that `use_sim_time` is set.
pub(crate) fn clock(core: &Arc<Core>, mut simulated: watch::Receiver<bool>) {
    core.clock.simulate(*simulated.borrow());
    let (weak, clock, stop) = (Arc::downgrade(core), core.clock.clone(), core.closing.clone());
    tokio::spawn(async move {
        if stop.or(simulated.wait_for(|on| *on)).await.is_none_or(|waited| waited.is_err()) {
            return;
        }
        clock.simulate(true);
        let made = weak.upgrade().map(|core| core.subscribe_with::<Clock>("/clock", &qos::clock()));
        let mut messages = match made {
            Some(Ok(messages)) => messages,
            Some(Err(error)) => return tracing::error!("no /clock: {error:#}"),
            None => return,
        };
        loop {
            tokio::select! {
                message = messages.next() => match message {
                    Some(message) => clock.set(message.clock.into()),
                    None => return,
                },
                changed = simulated.changed() => match changed {
                    Ok(()) => clock.simulate(*simulated.borrow()),
                    Err(_) => return,
                },
            }
        }
    });
}
