//! Receiving topics as bytes.

use super::info::BagMessage;
use super::route::{Route, TopicRoute, policies};
use crate::bulk::{BulkSubscription, Delivery};
use crate::clock::Clock;
use crate::dds::{Raw, Reader};
use crate::{Node, Stop};
use anyhow::Result;
use bytes::{BufMut, Bytes, BytesMut};
use puffer_core::params::Parameters;
use rustdds::RepresentationIdentifier;
use std::sync::Arc;
use tokio::sync::mpsc::{Receiver, Sender, channel};

/// Messages that wait to be written. While it is full, senders of bulk data are held back; other topics wait in DDS.
const WAITING: usize = 256;

/// Subscribes the topics and hands on their messages unread, stamped by the node's clock, until the node stops. The
/// names in the messages are resolved ones. A topic whose publishers offer less than its profile asks for stays silent:
/// [`Profile::Sensor`](crate::Profile::Sensor) takes from every publisher, but no latched messages.
///
/// # Errors
/// A name that is not allowed, a type that is none, or no resources.
pub fn record<P: Parameters>(
    node: &Node<P>,
    topics: &[TopicRoute],
) -> Result<Receiver<BagMessage>> {
    let (out, messages) = channel(WAITING);
    for entry in topics {
        let topic = node.resolve(&entry.topic)?;
        let dds_type = entry.dds_type()?;
        let ear = Ear {
            topic: topic.as_str().into(),
            type_name: entry.type_name.as_str().into(),
            clock: node.clock(),
            out: out.clone(),
            stop: node.stop(),
        };
        match entry.route {
            Route::Plain(profile) => {
                let name = format!("rt{topic}");
                let reader = node.dds().reader(&name, &dds_type, &policies(profile))?;
                tokio::spawn(ear.hear(reader));
            }
            Route::Bulk { .. } => {
                let samples = node.bulk_subscribe::<()>(&entry.topic, Delivery::Every)?;
                tokio::spawn(ear.hear_bulk(samples));
            }
        }
    }
    Ok(messages)
}

/// What listens to a topic.
struct Ear {
    topic: Arc<str>,
    type_name: Arc<str>,
    clock: Clock,
    out: Sender<BagMessage>,
    stop: Stop,
}

impl Ear {
    async fn hear(self, reader: Reader) {
        while let Some(sample) = self.stop.or(reader.next()).await {
            match sample {
                Ok(sample) => {
                    if !self.hand_on(with_header(&sample.raw)).await {
                        return;
                    }
                }
                Err(error) => tracing::warn!("{}: a message was not read: {error}", self.topic),
            }
        }
    }

    async fn hear_bulk(self, samples: BulkSubscription<()>) {
        while let Some(sample) = self.stop.or(samples.next_bytes()).await {
            match sample {
                Ok(bytes) => {
                    if !self.hand_on(bytes).await {
                        return;
                    }
                }
                Err(error) => {
                    tracing::warn!("{}: recording ends: {error}", self.topic);
                    return;
                }
            }
        }
    }

    /// False once nobody takes the messages.
    async fn hand_on(&self, bytes: Bytes) -> bool {
        let now = self.clock.now();
        let (topic, type_name) = (Arc::clone(&self.topic), Arc::clone(&self.type_name));
        let message = BagMessage { topic, type_name, bytes, log_time: now, publish_time: now };
        self.out.send(message).await.is_ok()
    }
}

/// The encapsulation header and the body.
fn with_header(raw: &Raw) -> Bytes {
    let order = u8::from(raw.encoding != RepresentationIdentifier::CDR_BE);
    let mut bytes = BytesMut::with_capacity(4 + raw.body.len());
    bytes.put_slice(&[0, order, 0, 0]);
    bytes.put_slice(&raw.body);
    bytes.freeze()
}
