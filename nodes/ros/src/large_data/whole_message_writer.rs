//! Writes whole messages on the named topic, as ordinary DDS samples, for readers that know nothing
//! of tiles.

use super::large_data_error::LargeDataError;
use super::outside_endpoints::count_outside_readers;
use super::sample_queue::{Delivery, QueueClosed, SampleQueue};
use super::socket_buffers::receive_buffer_limit;
use super::tile_topics::{create_error, spawn_thread};
use crate::dds::{PayloadAdapter, SerializedPayload, ros_topic};
use bytes::Bytes;
use ros2_client::MessageTypeName;
use rustdds::dds::CreateResult;
use rustdds::no_key::DataWriter;
use rustdds::policy::{Durability, History, Reliability, ResourceLimits};
use rustdds::{DomainParticipant, Duration as DdsDuration, QosPolicyBuilder, TopicKind};
use std::sync::Arc;
use std::time::Duration;

/// How often to look for the first reader of a latched message. rustdds tells of matched readers
/// only, and a reader that also takes tiles matches, too.
const DISCOVERY_POLL_PERIOD: Duration = Duration::from_millis(200);
/// Number of messages that DDS keeps while a reader has not acknowledged them: with the limit on
/// their size, a few megabytes.
const MAX_UNACKNOWLEDGED_MESSAGES: i32 = 4;
/// `net.core.rmem_max` of stock Debian and Ubuntu, for systems that do not tell theirs.
const STOCK_RECEIVE_BUFFER_BYTES: usize = 212_992;

/// The largest message that is sent whole, in bytes. Measured: messages up to `net.core.rmem_max`
/// arrive, those of twice its size only now and then.
pub(crate) fn max_whole_message_bytes() -> usize {
    receive_buffer_limit().unwrap_or(STOCK_RECEIVE_BUFFER_BYTES)
}

/// Passes whole messages on while there are readers that know nothing of tiles. Of messages that
/// come faster than they can be passed on, the newest counts: those readers watch, they do not
/// measure.
pub(crate) struct WholeMessageWriter {
    queue: Arc<SampleQueue>,
}

impl WholeMessageWriter {
    /// Starts the writer's thread. With `latched`, DDS keeps the newest message for readers that
    /// come later.
    pub(crate) fn new(
        participant: &DomainParticipant,
        topic: &str,
        kind: &MessageTypeName,
        latched: bool,
    ) -> Result<WholeMessageWriter, LargeDataError> {
        let writer = create_writer(participant, topic, kind, latched)
            .map_err(|error| create_error(topic, error))?;
        let queue = Arc::new(SampleQueue::new(Delivery::Newest));
        let messages = Arc::clone(&queue);
        let thread = WriterThread {
            topic: topic.to_owned(),
            participant: participant.clone(),
            writer,
            latched,
            max_bytes: max_whole_message_bytes(),
            unsent: None,
            lost: 0,
            has_warned_of_size: false,
        };
        spawn_thread(topic, "whole_writer", move || thread.run(messages))?;
        Ok(WholeMessageWriter { queue })
    }

    /// Hands over a serialized message with its encapsulation header.
    pub(crate) fn publish(&self, message: Bytes) {
        self.queue.push(message);
    }
}

impl Drop for WholeMessageWriter {
    fn drop(&mut self) {
        self.queue.close();
    }
}

/// What the writer's thread owns.
struct WriterThread {
    topic: String,
    participant: DomainParticipant,
    writer: DataWriter<SerializedPayload, PayloadAdapter>,
    latched: bool,
    max_bytes: usize,
    /// The newest message that is not sent; on a latched topic it waits for the first reader.
    unsent: Option<Bytes>,
    lost: u64,
    has_warned_of_size: bool,
}

impl WriterThread {
    async fn run(mut self, messages: Arc<SampleQueue>) {
        loop {
            match messages.take() {
                Ok(Some(message)) => self.unsent = Some(message),
                Ok(None) => {}
                Err(QueueClosed) => return,
            }
            self.send_if_read();
            tokio::select! {
                () = messages.filled.notified() => {}
                () = tokio::time::sleep(DISCOVERY_POLL_PERIOD), if self.unsent.is_some() => {}
            }
        }
    }

    /// Sends the unsent message if somebody reads. On a latched topic it waits for the first
    /// reader; once it has been written, DDS keeps it for readers that come later.
    fn send_if_read(&mut self) {
        let readers = count_outside_readers(&self.participant, &self.topic);
        if readers == 0 && self.latched {
            return;
        }
        let Some(message) = self.unsent.take() else { return };
        if readers == 0 {
            return;
        }
        if message.len() > self.max_bytes {
            self.warn_of_size(message.len(), readers);
            return;
        }
        let payload = SerializedPayload::from_message(&message);
        if let Err(error) = self.writer.write(payload, None) {
            self.lost += 1;
            tracing::warn!("{}: {} whole messages not sent: {error}", self.topic, self.lost);
        }
    }

    fn warn_of_size(&mut self, size: usize, readers: usize) {
        if !std::mem::replace(&mut self.has_warned_of_size, true) {
            tracing::warn!(
                "{}: messages of {size} bytes are not sent whole to the {readers} readers that take no tiles: socket \
                 buffers here carry {} bytes. `sysctl -w net.core.rmem_max={}` on every machine, and a restart, allow \
                 more",
                self.topic,
                self.max_bytes,
                size.next_power_of_two()
            );
        }
    }
}

fn create_writer(
    participant: &DomainParticipant,
    topic: &str,
    kind: &MessageTypeName,
    latched: bool,
) -> CreateResult<DataWriter<SerializedPayload, PayloadAdapter>> {
    let durability = if latched { Durability::TransientLocal } else { Durability::Volatile };
    let qos = QosPolicyBuilder::new()
        .reliability(Reliability::Reliable { max_blocking_time: DdsDuration::ZERO })
        .durability(durability)
        .history(History::KeepLast { depth: 1 })
        .resource_limits(ResourceLimits {
            max_samples: MAX_UNACKNOWLEDGED_MESSAGES,
            max_instances: 1,
            max_samples_per_instance: MAX_UNACKNOWLEDGED_MESSAGES,
        })
        .build();
    let name = ros_topic(topic);
    let topic = participant.create_topic(name, kind.dds_msg_type(), &qos, TopicKind::NoKey)?;
    participant.create_publisher(&qos)?.create_datawriter_no_key(&topic, Some(qos))
}
