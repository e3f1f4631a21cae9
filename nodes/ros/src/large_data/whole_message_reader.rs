//! Reads whole messages from the named topic, of writers that know nothing of tiles. The DDS reader
//! is made only when there is such a writer: with a reader that is always there, puffer's own
//! writers would send everything twice.

use super::large_data_error::LargeDataError;
use super::outside_endpoints::{outside_writer_qos, writes_tiles};
use super::sample_queue::SampleQueue;
use super::tile_topics::{create_error, spawn_thread};
use crate::dds::{PayloadAdapter, SerializedPayload, ros_topic};
use futures::StreamExt;
use ros2_client::MessageTypeName;
use rustdds::dds::CreateResult;
use rustdds::no_key::SimpleDataReader;
use rustdds::policy::History;
use rustdds::{DomainParticipant, QosPolicies, QosPolicyBuilder, TopicKind};
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::oneshot;

/// How often to look for a writer: rustdds tells of writers that match a reader only, and the
/// reader waits for the writer here.
const DISCOVERY_POLL_PERIOD: Duration = Duration::from_millis(100);
/// Number of whole messages that DDS keeps.
const HISTORY_DEPTH: i32 = 4;

/// Starts the thread that looks for writers and adds their messages to `queue`. It ends when what
/// is returned is dropped.
pub(crate) fn start_whole_message_reader(
    participant: &DomainParticipant,
    topic: &str,
    kind: &MessageTypeName,
    queue: Arc<SampleQueue>,
) -> Result<oneshot::Sender<()>, LargeDataError> {
    let (alive, mut dropped) = oneshot::channel();
    let reader = WholeMessageReader {
        participant: participant.clone(),
        topic: topic.to_owned(),
        kind: kind.dds_msg_type(),
        queue,
        lost: 0,
    };
    spawn_thread(topic, "whole_reader", move || async move {
        tokio::select! {
            () = reader.run() => {}
            _ = &mut dropped => {}
        }
    })?;
    Ok(alive)
}

/// What the reader's thread owns.
struct WholeMessageReader {
    participant: DomainParticipant,
    topic: String,
    kind: String,
    queue: Arc<SampleQueue>,
    lost: u64,
}

impl WholeMessageReader {
    async fn run(mut self) {
        loop {
            let qos = self.wait_for_writer().await;
            match self.create_reader(&qos) {
                Ok(reader) => self.read(&reader, &qos).await,
                Err(error) => {
                    tracing::error!("{}", create_error(&self.topic, error));
                    return;
                }
            }
        }
    }

    /// Waits for a writer that knows nothing of tiles; returns the QoS to request.
    async fn wait_for_writer(&self) -> QosPolicies {
        // DDS tells nobody of the writers that it discovers.
        let mut ticks = tokio::time::interval(DISCOVERY_POLL_PERIOD);
        loop {
            ticks.tick().await;
            if let Some(qos) = outside_writer_qos(&self.participant, &self.topic) {
                return qos;
            }
        }
    }

    fn create_reader(
        &self,
        qos: &QosPolicies,
    ) -> CreateResult<SimpleDataReader<SerializedPayload, PayloadAdapter>> {
        let history = History::KeepLast { depth: HISTORY_DEPTH };
        let qos = qos.modify_by(&QosPolicyBuilder::new().history(history).build());
        let (name, kind) = (ros_topic(&self.topic), self.kind.clone());
        let topic = self.participant.create_topic(name, kind, &qos, TopicKind::NoKey)?;
        let subscriber = self.participant.create_subscriber(&qos)?;
        subscriber.create_simple_datareader_no_key(&topic, Some(qos))
    }

    /// Reads until another QoS has to be requested: a driver came back with another one.
    async fn read(
        &mut self,
        reader: &SimpleDataReader<SerializedPayload, PayloadAdapter>,
        qos: &QosPolicies,
    ) {
        let mut messages = pin!(reader.as_async_stream());
        loop {
            tokio::select! {
                message = messages.next() => match message {
                    Some(Ok(message)) => {
                        let writer = message.writer_guid();
                        if !writes_tiles(&self.participant, &self.topic, writer) {
                            self.push(&message.into_value());
                        }
                    }
                    Some(Err(error)) => {
                        tracing::warn!("{}: a whole message is unreadable: {error}", self.topic);
                    }
                    None => return,
                },
                () = tokio::time::sleep(DISCOVERY_POLL_PERIOD) => {
                    let offered = outside_writer_qos(&self.participant, &self.topic);
                    if offered.is_some_and(|offered| offered != *qos) {
                        return;
                    }
                }
            }
        }
    }

    fn push(&mut self, message: &SerializedPayload) {
        if self.queue.push_evicting_oldest(message.to_message()) {
            self.lost += 1;
            tracing::warn!(
                "{}: {} whole messages came faster than they were taken, and are lost",
                self.topic,
                self.lost
            );
        }
    }
}
