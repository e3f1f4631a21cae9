//! What every ROS 2 node has: `/rosout`, `/diagnostics`, the clock, parameter services.

use super::Node;
use crate::clock::Clock;
use crate::{Diagnostics, Profile, Publisher, Stop, Subscription, params, qos};
use anyhow::Result;
use puffer_core::params::Parameters;
use puffer_msgs::diagnostic_msgs::msg::DiagnosticArray;
use puffer_msgs::rcl_interfaces::msg::Log;
use puffer_msgs::rosgraph_msgs::msg;
use rustdds::policy::Durability;
use std::time::Duration;
use tokio::sync::mpsc::UnboundedReceiver;
use tokio::sync::watch;

const DIAGNOSTICS_PERIOD: Duration = Duration::from_secs(1);

impl<P: Parameters> Node<P> {
    /// Starts what every node offers: its log, diagnostics, clock and parameters.
    pub(super) fn start_standard(&self, lines: UnboundedReceiver<Log>, rosout: bool) -> Result<()> {
        let inner = &self.inner;
        if rosout {
            let latched = qos::events(Durability::TransientLocal);
            let out = Publisher::new(&inner.dds, &self.resolve("/rosout")?, &latched)?;
            tokio::spawn(send_lines(lines, out, inner.stop.clone()));
        }
        let out = self.publisher("/diagnostics", Profile::Standard)?;
        tokio::spawn(diagnose(
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
        tokio::spawn(follow(time, simulated, inner.clock.clone()));
        let volatile = qos::events(Durability::Volatile);
        let events = Publisher::new(&inner.dds, &self.resolve("/parameter_events")?, &volatile)?;
        params::serve(self, &inner.params, inner.clock.clone(), events)
    }
}

async fn send_lines(mut lines: UnboundedReceiver<Log>, out: Publisher<Log>, stop: Stop) {
    while let Some(Some(line)) = stop.or(lines.recv()).await {
        // A line about it would come here again; standard error has the line.
        let _ = out.publish(&line);
    }
}

async fn diagnose(
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

async fn follow(
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
