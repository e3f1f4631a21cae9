//! Publishing the messages of a bag.

use super::error::BagError;
use super::info::BagMessage;
use super::messages::Messages;
use super::route::{Route, TopicRoute, policies};
use crate::bulk::{BulkPublisher, Mode};
use crate::dds::Writer;
use crate::{Node, Stop};
use anyhow::{Context, Result, anyhow, bail};
use puffer_core::params::Parameters;
use std::collections::BTreeMap;
use std::time::Duration;
use tokio::sync::mpsc::{Receiver, channel};
use tokio::time::Instant;

/// Messages read ahead of time.
const AHEAD: usize = 8;
/// Bulk messages held for readers that lag behind.
const BULK_DEPTH: usize = 4;
/// How often [`Player::wait_for_readers`] looks.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Publishes a bag's messages as they were recorded, byte for byte.
pub struct Player {
    outlets: BTreeMap<String, Outlet>,
    stop: Stop,
}

enum Outlet {
    Plain(Box<Writer>),
    Bulk(BulkPublisher),
}

impl Player {
    /// Announces the topics; those of the bag that are not named are not played. The bag's name of a topic is the one
    /// given here, which the node may remap.
    ///
    /// # Errors
    /// A name that is not allowed, a type that is none, or no resources.
    pub fn new<P: Parameters>(node: &Node<P>, topics: &[TopicRoute]) -> Result<Player> {
        let mut outlets = BTreeMap::new();
        for entry in topics {
            let outlet = match entry.route {
                Route::Plain(profile) => {
                    let name = format!("rt{}", node.resolve(&entry.topic)?);
                    let writer =
                        node.dds().writer(&name, &entry.dds_type()?, &policies(profile))?;
                    Outlet::Plain(Box::new(writer))
                }
                Route::Bulk { latched } => {
                    let mode =
                        if latched { Mode::Latched } else { Mode::Queue { depth: BULK_DEPTH } };
                    Outlet::Bulk(node.bulk_publisher(&entry.topic, mode)?)
                }
            };
            outlets.insert(entry.topic.clone(), outlet);
        }
        Ok(Player { outlets, stop: node.stop() })
    }

    /// Waits until each topic has a reader.
    ///
    /// # Errors
    /// Names the topics that have none after `within` (wall time).
    pub async fn wait_for_readers(&self, within: Duration) -> Result<()> {
        let until = Instant::now() + within;
        loop {
            let lonely: Vec<&str> = self
                .outlets
                .iter()
                .filter(|(_, outlet)| outlet.readers() == 0)
                .map(|(topic, _)| topic.as_str())
                .collect();
            if lonely.is_empty() {
                return Ok(());
            }
            if Instant::now() >= until {
                let seconds = within.as_secs_f64();
                bail!("within {seconds:.1} s nobody came to read {}", lonely.join(", "));
            }
            tokio::time::sleep(LOOK_EVERY).await;
        }
    }

    /// Publishes the messages at their times, `rate` times as fast; without a rate as fast as they go out, which plain
    /// topics with slow readers do not survive whole. Ends early when the node stops. Returns how many it published.
    ///
    /// Each message waits for `before`, and while it waits the bag's time stands still: who must not be outrun can hold
    /// the player up.
    ///
    /// # Errors
    /// A rate that is none, a bag that cannot be read on, a message that cannot be published, or what `before` says.
    pub async fn play(
        &self,
        messages: Messages,
        rate: Option<f64>,
        mut before: impl AsyncFnMut(&BagMessage) -> Result<()>,
    ) -> Result<u64> {
        if rate.is_some_and(|rate| !rate.is_finite() || rate <= 0.0) {
            bail!("rate {:?}: it must be a number above 0", rate.unwrap_or_default());
        }
        let mut messages = read_ahead(messages);
        let mut first = None;
        let mut held = Duration::ZERO;
        let mut count = 0;
        while let Some(Some(message)) = self.stop.or(messages.recv()).await {
            let message = message?;
            let Some(outlet) = self.outlets.get(&*message.topic) else { continue };
            let since = Instant::now();
            let Some(free) = self.stop.or(before(&message)).await else { break };
            free?;
            held += since.elapsed();
            if let Some(rate) = rate {
                let (start, begun) = *first.get_or_insert((message.log_time, Instant::now()));
                let offset = message.log_time.seconds_since(start).max(0.0) / rate;
                let offset = Duration::try_from_secs_f64(offset)
                    .with_context(|| format!("rate {rate}: too slow"))?;
                if self.stop.or(tokio::time::sleep_until(begun + held + offset)).await.is_none() {
                    break;
                }
            }
            outlet.publish(&message).await?;
            count += 1;
        }
        Ok(count)
    }

    /// Waits until the readers of bulk topics have everything.
    ///
    /// # Errors
    /// A reader lacks something after `within` (wall time), for each topic.
    pub async fn flush(&self, within: Duration) -> Result<()> {
        for outlet in self.outlets.values() {
            if let Outlet::Bulk(publisher) = outlet {
                publisher.flush(within).await?;
            }
        }
        Ok(())
    }
}

impl Outlet {
    fn readers(&self) -> usize {
        match self {
            Outlet::Plain(writer) => writer.matches().count(writer.guid()),
            Outlet::Bulk(publisher) => publisher.stats().readers,
        }
    }

    async fn publish(&self, message: &BagMessage) -> Result<()> {
        let (topic, time) = (&message.topic, message.log_time);
        match (self, &message.bytes[..]) {
            (Outlet::Bulk(publisher), _) => {
                publisher.publish(message.bytes.clone()).await?;
            }
            (Outlet::Plain(writer), [0, 1, _, _, body @ ..]) => {
                if let Err(error) = writer.write(body.to_vec(), None) {
                    tracing::warn!("{topic} at {time}: {error}");
                }
            }
            (Outlet::Plain(_), bytes) => {
                let start = &bytes[..bytes.len().min(4)];
                return Err(anyhow!(
                    "{topic} at {time}: only little-endian CDR is played; the message begins with {start:02x?}"
                ));
            }
        }
        Ok(())
    }
}

/// Reads and unpacks in a thread of its own.
fn read_ahead(messages: Messages) -> Receiver<Result<BagMessage, BagError>> {
    let (ahead, receiver) = channel(AHEAD);
    tokio::task::spawn_blocking(move || {
        for message in messages {
            if ahead.blocking_send(message).is_err() {
                return;
            }
        }
    });
    receiver
}
