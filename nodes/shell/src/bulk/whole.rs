//! Whole messages on the named topic, for readers that know nothing of tiles.

use super::error::BulkError;
use super::graph::{dds_name, outside_readers};
use super::host::receive_buffer_limit;
use super::inbox::{Closed, Delivery, Inbox};
use super::topic::{refused, start};
use crate::dds::{Raw, RawAdapter};
use bytes::Bytes;
use ros2_client::MessageTypeName;
use rustdds::dds::CreateResult;
use rustdds::no_key::DataWriter;
use rustdds::policy::{Durability, History, Reliability, ResourceLimits};
use rustdds::{DomainParticipant, Duration as DdsDuration, QosPolicyBuilder, TopicKind};
use std::sync::Arc;
use std::time::Duration;

/// How often to look for readers of a latched message.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// Messages that DDS keeps while a reader has not acknowledged them: with the limit on their size, a few megabytes.
const KEPT: i32 = 4;
/// `net.core.rmem_max` of stock Debian and Ubuntu, where the system does not tell.
const STOCK_LIMIT: usize = 212_992;

/// Bytes of a message at most. Measured: messages up to rmem_max arrive, those of twice its size only now and then.
pub(crate) fn largest_message() -> usize {
    receive_buffer_limit().unwrap_or(STOCK_LIMIT)
}

/// Passes on whole messages while outsiders read them. Of messages that come faster than they can be passed on, the
/// newest counts: outsiders watch, they do not measure.
pub(crate) struct Whole {
    newest: Arc<Inbox>,
}

impl Whole {
    pub(crate) fn new(
        participant: &DomainParticipant,
        topic: &str,
        kind: &MessageTypeName,
        latched: bool,
    ) -> Result<Whole, BulkError> {
        let writer =
            make(participant, topic, kind, latched).map_err(|error| refused(topic, error))?;
        let newest = Arc::new(Inbox::new(Delivery::Newest));
        let messages = Arc::clone(&newest);
        let run = Run {
            topic: topic.to_owned(),
            participant: participant.clone(),
            writer,
            latched,
            largest: largest_message(),
            unsent: None,
            lost: 0,
            told: false,
        };
        start(topic, "bulk_whole", move || run.run(messages))?;
        Ok(Whole { newest })
    }

    pub(crate) fn publish(&self, message: Bytes) {
        self.newest.put(message);
    }
}

impl Drop for Whole {
    fn drop(&mut self) {
        self.newest.close();
    }
}

struct Run {
    topic: String,
    participant: DomainParticipant,
    writer: DataWriter<Raw, RawAdapter>,
    latched: bool,
    largest: usize,
    /// The newest message of a latched topic, until somebody reads.
    unsent: Option<Bytes>,
    lost: u64,
    told: bool,
}

impl Run {
    async fn run(mut self, messages: Arc<Inbox>) {
        loop {
            match messages.take() {
                Ok(Some(message)) => self.unsent = Some(message),
                Ok(None) => {}
                Err(Closed) => return,
            }
            self.send();
            tokio::select! {
                () = messages.filled.notified() => {}
                () = tokio::time::sleep(LOOK_EVERY), if self.unsent.is_some() => {}
            }
        }
    }

    /// Sends what is unsent if somebody reads. A latched message waits for the first reader; once it has been written,
    /// DDS keeps it for those that come later.
    fn send(&mut self) {
        let readers = outside_readers(&self.participant, &self.topic);
        if readers == 0 && self.latched {
            return;
        }
        let Some(message) = self.unsent.take() else { return };
        if readers == 0 {
            return;
        }
        if message.len() > self.largest {
            self.tell_too_large(message.len(), readers);
        } else if let Err(error) = self.writer.write(Raw::of_message(&message), None) {
            self.lost += 1;
            tracing::warn!("{}: {} whole messages not sent: {error}", self.topic, self.lost);
        }
    }

    fn tell_too_large(&mut self, size: usize, readers: usize) {
        if !std::mem::replace(&mut self.told, true) {
            tracing::warn!(
                "{}: messages of {size} bytes are not sent whole to the {readers} readers that take no tiles: socket \
                 buffers here carry {} bytes. `sysctl -w net.core.rmem_max={}` on every machine, and a restart, allow \
                 more",
                self.topic,
                self.largest,
                size.next_power_of_two()
            );
        }
    }
}

fn make(
    participant: &DomainParticipant,
    topic: &str,
    kind: &MessageTypeName,
    latched: bool,
) -> CreateResult<DataWriter<Raw, RawAdapter>> {
    let durability = if latched { Durability::TransientLocal } else { Durability::Volatile };
    let quality = QosPolicyBuilder::new()
        .reliability(Reliability::Reliable { max_blocking_time: DdsDuration::ZERO })
        .durability(durability)
        .history(History::KeepLast { depth: 1 })
        .resource_limits(ResourceLimits {
            max_samples: KEPT,
            max_instances: 1,
            max_samples_per_instance: KEPT,
        })
        .build();
    let name = dds_name(topic);
    let topic = participant.create_topic(name, kind.dds_msg_type(), &quality, TopicKind::NoKey)?;
    participant.create_publisher(&quality)?.create_datawriter_no_key(&topic, Some(quality))
}
