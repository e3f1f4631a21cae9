//! Whole messages from the named topic, of writers that know nothing of tiles. The DDS reader is made when there is
//! such a writer: a reader that is always there would have our own writers send everything twice.

use super::error::BulkError;
use super::graph::{dds_name, outside_writer, writes_tiles};
use super::inbox::Inbox;
use super::topic::{refused, start};
use crate::dds::{Raw, RawAdapter};
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

/// How often to look for a writer.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// Whole messages that DDS keeps.
const KEPT: i32 = 4;

/// Starts to look for writers; ends when what is returned is dropped.
pub(crate) fn start_plain(
    participant: &DomainParticipant,
    topic: &str,
    kind: &MessageTypeName,
    inbox: Arc<Inbox>,
) -> Result<oneshot::Sender<()>, BulkError> {
    let (alive, mut dropped) = oneshot::channel();
    let run = Run {
        participant: participant.clone(),
        topic: topic.to_owned(),
        kind: kind.dds_msg_type(),
        inbox,
        lost: 0,
    };
    start(topic, "bulk_plain", move || async move {
        tokio::select! {
            () = run.run() => {}
            _ = &mut dropped => {}
        }
    })?;
    Ok(alive)
}

struct Run {
    participant: DomainParticipant,
    topic: String,
    kind: String,
    inbox: Arc<Inbox>,
    lost: u64,
}

impl Run {
    async fn run(mut self) {
        loop {
            let quality = loop {
                match outside_writer(&self.participant, &self.topic) {
                    Some(quality) => break quality,
                    None => tokio::time::sleep(LOOK_EVERY).await,
                }
            };
            match self.reader(&quality) {
                Ok(reader) => self.read(&reader, &quality).await,
                Err(error) => {
                    tracing::error!("{}", refused(&self.topic, error));
                    return;
                }
            }
        }
    }

    fn reader(&self, quality: &QosPolicies) -> CreateResult<SimpleDataReader<Raw, RawAdapter>> {
        let kept = QosPolicyBuilder::new().history(History::KeepLast { depth: KEPT }).build();
        let quality = quality.modify_by(&kept);
        let (name, kind) = (dds_name(&self.topic), self.kind.clone());
        let topic = self.participant.create_topic(name, kind, &quality, TopicKind::NoKey)?;
        let subscriber = self.participant.create_subscriber(&quality)?;
        subscriber.create_simple_datareader_no_key(&topic, Some(quality))
    }

    /// Reads until another quality has to be asked for: a driver came back with another one.
    async fn read(&mut self, reader: &SimpleDataReader<Raw, RawAdapter>, quality: &QosPolicies) {
        let mut messages = pin!(reader.as_async_stream());
        loop {
            tokio::select! {
                message = messages.next() => match message {
                    Some(Ok(message)) => {
                        let from = message.writer_guid();
                        if !writes_tiles(&self.participant, &self.topic, from) {
                            self.put(message.into_value());
                        }
                    }
                    Some(Err(error)) => {
                        tracing::warn!("{}: a whole message is unreadable: {error}", self.topic);
                    }
                    None => return,
                },
                () = tokio::time::sleep(LOOK_EVERY) => {
                    let now = outside_writer(&self.participant, &self.topic);
                    if now.is_some_and(|now| now != *quality) {
                        return;
                    }
                }
            }
        }
    }

    fn put(&mut self, message: Raw) {
        if self.inbox.press_in(message.message()) {
            self.lost += 1;
            tracing::warn!(
                "{}: {} whole messages came faster than they were taken, and are lost",
                self.topic,
                self.lost
            );
        }
    }
}
