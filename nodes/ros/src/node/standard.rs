//! What every node has: `/rosout`, `/diagnostics`, the clock and the parameter services.

use super::Node;
use crate::clock::Clock;
use crate::{Diagnostics, Publisher, QosProfile, Stop, Subscription, params, qos};
use anyhow::Result;
use puffer_core::params::Parameters;
use puffer_msgs::diagnostic_msgs::msg::DiagnosticArray;
use puffer_msgs::rcl_interfaces::msg::Log;
use puffer_msgs::rosgraph_msgs::msg;
use rustdds::policy::Durability;
use std::time::Duration;
use tokio::sync::mpsc::UnboundedReceiver;
use tokio::sync::watch;

/// How often a node publishes `/diagnostics`.
const DIAGNOSTICS_PERIOD: Duration = Duration::from_secs(1);

impl<P: Parameters> Node<P> {
    /// Starts the log, diagnostics, clock and parameter services of the node.
    pub(super) fn start_standard(&self, lines: UnboundedReceiver<Log>, rosout: bool) -> Result<()> {
        let inner = &self.inner;
        if rosout {
            let latched = qos::events(Durability::TransientLocal);
            let out = Publisher::new(&inner.dds, &self.resolve("/rosout")?, &latched)?;
            tokio::spawn(publish_log(lines, out, inner.stop.clone()));
        }
        let out = self.publisher("/diagnostics", QosProfile::Standard)?;
        tokio::spawn(publish_diagnostics(
            inner.diagnostics.clone(),
            out,
            self.full_name(),
            inner.clock.clone(),
            inner.stop.clone(),
        ));
        let simulated = inner.params.watch_sim_time();
        inner.clock.simulate(*simulated.borrow());
        let topic = self.resolve("/clock")?;
        let time = Subscription::new(&inner.dds, &topic, &qos::clock(), inner.stop.clone())?;
        tokio::spawn(follow_clock(time, simulated, inner.clock.clone()));
        let volatile = qos::events(Durability::Volatile);
        let events = Publisher::new(&inner.dds, &self.resolve("/parameter_events")?, &volatile)?;
        params::serve(self, &inner.params, inner.clock.clone(), events)
    }
}

/// Publishes log lines on `/rosout`.
async fn publish_log(mut lines: UnboundedReceiver<Log>, out: Publisher<Log>, stop: Stop) {
    while let Some(Some(line)) = stop.or(lines.recv()).await {
        // A log line about a failure would come here again; standard error has the line.
        let _ = out.publish(&line);
    }
}

/// Publishes `/diagnostics` periodically.
async fn publish_diagnostics(
    diagnostics: Diagnostics,
    out: Publisher<DiagnosticArray>,
    node: String,
    clock: Clock,
    stop: Stop,
) {
    let mut ticks = tokio::time::interval(DIAGNOSTICS_PERIOD);
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    while stop.or(ticks.tick()).await.is_some() {
        let mut message = diagnostics.message(&node);
        message.header.stamp = clock.now().into();
        if let Err(error) = out.publish(&message) {
            tracing::debug!("{error:#}");
        }
    }
}

/// Sets the simulated time from `/clock`, and switches it as `use_sim_time` says.
async fn follow_clock(
    mut messages: Subscription<msg::Clock>,
    mut simulated: watch::Receiver<bool>,
    clock: Clock,
) {
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
}
