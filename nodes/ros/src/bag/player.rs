//! Publishes the messages of a bag.

use super::bag_error::BagError;
use super::bag_info::BagMessage;
use super::message_iterator::Messages;
use super::topic_route::{Route, TopicRoute, recording_policies};
use crate::dds::{Writer, ros_topic};
use crate::large_data::{LargeDataPublisher, Retention};
use crate::{Node, Stop};
use anyhow::{Context, Result, anyhow, bail};
use puffer_core::params::Parameters;
use std::collections::BTreeMap;
use std::time::Duration;
use tokio::sync::mpsc::{Receiver, channel};
use tokio::time::Instant;

/// Number of messages that are read ahead of time.
const MAX_MESSAGES_AHEAD: usize = 8;
/// Number of messages of a large-data topic that are held for readers that lag behind.
const LARGE_DATA_QUEUE_DEPTH: usize = 4;

/// Publishes the messages of a bag as they were recorded, byte for byte.
pub struct Player {
    writers: BTreeMap<String, TopicWriter>,
    stop: Stop,
}

/// How a topic is published.
enum TopicWriter {
    Samples(Box<Writer>),
    Tiles(LargeDataPublisher),
}

impl Player {
    /// Announces the topics; topics of the bag that are not named here are not played. `topics`
    /// have the names of the bag, which the node may remap.
    ///
    /// # Errors
    /// A name or type that is not allowed, or DDS makes no endpoints.
    pub fn new<P: Parameters>(node: &Node<P>, topics: &[TopicRoute]) -> Result<Player> {
        let mut writers = BTreeMap::new();
        for entry in topics {
            let writer = match entry.route {
                Route::Samples(profile) => {
                    let name = ros_topic(&node.resolve(&entry.topic)?);
                    let writer = node.dds().writer(
                        &name,
                        &entry.dds_type()?,
                        &recording_policies(profile),
                    )?;
                    TopicWriter::Samples(Box::new(writer))
                }
                Route::Tiles { latched } => {
                    let mode = if latched {
                        Retention::Latched
                    } else {
                        Retention::Queue { depth: LARGE_DATA_QUEUE_DEPTH }
                    };
                    TopicWriter::Tiles(node.large_data_publisher(&entry.topic, mode)?)
                }
            };
            writers.insert(entry.topic.clone(), writer);
        }
        Ok(Player { writers, stop: node.stop() })
    }

    /// Waits until each topic has a reader.
    ///
    /// # Errors
    /// After `within` (wall time), naming the topics that have none.
    pub async fn wait_for_readers(&self, within: Duration) -> Result<()> {
        if tokio::time::timeout(within, self.wait_for_all_readers()).await.is_ok() {
            return Ok(());
        }
        let unread = self.writers.iter().filter(|(_, writer)| writer.readers() == 0);
        let unread: Vec<&str> = unread.map(|(topic, _)| topic.as_str()).collect();
        if unread.is_empty() {
            return Ok(());
        }
        let seconds = within.as_secs_f64();
        bail!("within {seconds:.1} s nobody came to read {}", unread.join(", "))
    }

    /// Resolves when each topic has a reader, all at the same time.
    async fn wait_for_all_readers(&self) {
        while let Some(unread) = self.writers.values().find(|writer| writer.readers() == 0) {
            unread.wait_for_reader().await;
        }
    }

    /// Publishes the messages at their log times, `rate` times as fast. Without a rate they go out
    /// as fast as possible, and topics that are not large data lose messages if readers are slow.
    /// Ends early when the node stops. Returns how many messages were published.
    ///
    /// Each message waits for `before`, and while it waits the bag's time stands still, so that a
    /// node that must not be outrun can hold the player up.
    ///
    /// # Errors
    /// A rate that is not a positive number, a bag that cannot be read on, a message that cannot be
    /// published, or the error of `before`.
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
        let mut paused = Duration::ZERO;
        let mut count = 0;
        while let Some(Some(message)) = self.stop.or(messages.recv()).await {
            let message = message?;
            let Some(writer) = self.writers.get(&*message.topic) else { continue };
            let since = Instant::now();
            let Some(released) = self.stop.or(before(&message)).await else { break };
            released?;
            paused += since.elapsed();
            if let Some(rate) = rate {
                let (start, begun) = *first.get_or_insert((message.log_time, Instant::now()));
                let offset = message.log_time.seconds_since(start).max(0.0) / rate;
                let offset = Duration::try_from_secs_f64(offset)
                    .with_context(|| format!("rate {rate}: too slow"))?;
                if !self.wait_until_due(begun + paused + offset).await {
                    break;
                }
            }
            writer.publish(&message).await?;
            count += 1;
        }
        Ok(count)
    }

    /// Waits until the readers of large-data topics have everything.
    ///
    /// # Errors
    /// If a reader lacks something after `within` (wall time, for each topic).
    pub async fn flush(&self, within: Duration) -> Result<()> {
        for writer in self.writers.values() {
            if let TopicWriter::Tiles(publisher) = writer {
                publisher.flush(within).await?;
            }
        }
        Ok(())
    }

    /// Waits until a message is due; returns false if the node stops before.
    async fn wait_until_due(&self, time: Instant) -> bool {
        self.stop.or(tokio::time::sleep_until(time)).await.is_some()
    }
}

impl TopicWriter {
    fn readers(&self) -> usize {
        match self {
            TopicWriter::Samples(writer) => writer.matches().count(writer.guid()),
            TopicWriter::Tiles(publisher) => publisher.stats().readers,
        }
    }

    /// Resolves when the topic has a reader.
    async fn wait_for_reader(&self) {
        match self {
            TopicWriter::Samples(writer) => {
                writer.matches().wait(|matches| matches.count(writer.guid()) > 0).await;
            }
            TopicWriter::Tiles(publisher) => publisher.wait_for_first_reader().await,
        }
    }

    async fn publish(&self, message: &BagMessage) -> Result<()> {
        let (topic, time) = (&message.topic, message.log_time);
        match (self, &message.bytes[..]) {
            (TopicWriter::Tiles(publisher), _) => {
                publisher.publish(message.bytes.clone()).await?;
            }
            (TopicWriter::Samples(writer), [0, 1, _, _, body @ ..]) => {
                if let Err(error) = writer.write(body.to_vec(), None) {
                    tracing::warn!("{topic} at {time}: {error}");
                }
            }
            (TopicWriter::Samples(_), bytes) => {
                let start = &bytes[..bytes.len().min(4)];
                return Err(anyhow!(
                    "{topic} at {time}: only little-endian CDR is played; the message begins with {start:02x?}"
                ));
            }
        }
        Ok(())
    }
}

/// Reads and unpacks the messages in a thread of its own.
fn read_ahead(messages: Messages) -> Receiver<Result<BagMessage, BagError>> {
    let (ahead, receiver) = channel(MAX_MESSAGES_AHEAD);
    tokio::task::spawn_blocking(move || {
        for message in messages {
            if ahead.blocking_send(message).is_err() {
                return;
            }
        }
    });
    receiver
}
