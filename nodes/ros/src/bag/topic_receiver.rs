//! Receives topics as serialized messages of any type.

use super::bag_info::BagMessage;
use super::topic_route::{Route, TopicRoute, recording_policies};
use crate::clock::Clock;
use crate::dds::{Reader, ros_topic};
use crate::large_data::{Delivery, LargeDataSubscription};
use crate::{Node, Stop};
use anyhow::Result;
use bytes::Bytes;
use puffer_core::params::Parameters;
use std::sync::Arc;
use tokio::sync::mpsc::{Receiver, Sender, channel};

/// Number of messages that wait to be written. While so many do, writers of large data are held
/// back, and other topics wait in DDS.
const MAX_WAITING_MESSAGES: usize = 256;

/// Subscribes to the topics and hands on their serialized messages, with log times of the node's
/// clock, until the node stops. The messages bear resolved topic names.
///
/// A topic whose publishers offer less than its profile requests stays silent:
/// [`QosProfile::Sensor`](crate::QosProfile::Sensor) receives from every publisher, but no latched
/// messages.
///
/// # Errors
/// A name or type that is not allowed, or DDS makes no endpoints.
pub fn receive_topics<P: Parameters>(
    node: &Node<P>,
    topics: &[TopicRoute],
) -> Result<Receiver<BagMessage>> {
    let (out, messages) = channel(MAX_WAITING_MESSAGES);
    for entry in topics {
        let topic = node.resolve(&entry.topic)?;
        let dds_type = entry.dds_type()?;
        let receiver = TopicReceiver {
            topic: topic.as_str().into(),
            type_name: entry.type_name.as_str().into(),
            clock: node.clock(),
            out: out.clone(),
            stop: node.stop(),
        };
        match entry.route {
            Route::Samples(profile) => {
                let name = ros_topic(&topic);
                let reader = node.dds().reader(&name, &dds_type, &recording_policies(profile))?;
                tokio::spawn(receiver.forward_samples(reader));
            }
            Route::Tiles { .. } => {
                let samples = node.large_data_subscribe::<()>(&entry.topic, Delivery::Every)?;
                tokio::spawn(receiver.forward_large_data(samples));
            }
        }
    }
    Ok(messages)
}

/// Receives one topic.
struct TopicReceiver {
    topic: Arc<str>,
    type_name: Arc<str>,
    clock: Clock,
    out: Sender<BagMessage>,
    stop: Stop,
}

impl TopicReceiver {
    async fn forward_samples(self, reader: Reader) {
        while let Some(sample) = self.stop.or(reader.next()).await {
            match sample {
                Ok(sample) => {
                    if !self.forward(sample.payload.to_message()).await {
                        return;
                    }
                }
                Err(error) => tracing::warn!("{}: a message was not read: {error}", self.topic),
            }
        }
    }

    async fn forward_large_data(self, samples: LargeDataSubscription<()>) {
        while let Some(sample) = self.stop.or(samples.next_bytes()).await {
            match sample {
                Ok(bytes) => {
                    if !self.forward(bytes).await {
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

    /// Sends a message on; returns false once nobody takes the messages.
    async fn forward(&self, bytes: Bytes) -> bool {
        let now = self.clock.now();
        let (topic, type_name) = (Arc::clone(&self.topic), Arc::clone(&self.type_name));
        let message = BagMessage { topic, type_name, bytes, log_time: now, publish_time: now };
        self.out.send(message).await.is_ok()
    }
}
