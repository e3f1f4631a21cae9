//! Publishers and subscriptions.

use crate::Stop;
use crate::dds::{Participant, Reader, ReceivedSample, Writer, encode, ros_topic, type_name};
use anyhow::{Context, Result, anyhow, bail};
use puffer_msgs::Interface;
use rustdds::QosPolicies;
use std::marker::PhantomData;
use std::sync::Arc;
use std::time::Duration;

/// Publishes messages of type `M`. Clones share the publisher.
///
/// ```no_run
/// # use puffer_ros::{NoParams, Node, QosProfile};
/// # use puffer_msgs::std_msgs::msg::Header;
/// # async fn example(node: &Node<NoParams>) -> anyhow::Result<()> {
/// let publisher = node.publisher::<Header>("~/status", QosProfile::Latched)?;
/// publisher.publish(&Header { stamp: node.now().into(), frame_id: "object".to_owned() })?;
/// # Ok(())
/// # }
/// ```
pub struct Publisher<M> {
    writer: Arc<Writer>,
    topic: Arc<str>,
    message: PhantomData<fn(M)>,
}

impl<M> Clone for Publisher<M> {
    fn clone(&self) -> Self {
        Self {
            writer: Arc::clone(&self.writer),
            topic: Arc::clone(&self.topic),
            message: PhantomData,
        }
    }
}

impl<M: Interface> Publisher<M> {
    pub(crate) fn new(dds: &Participant, topic: &str, qos: &QosPolicies) -> Result<Self> {
        let kind = type_name(M::PACKAGE, M::KIND, M::NAME, "");
        let writer = Arc::new(dds.writer(&ros_topic(topic), &kind, qos)?);
        Ok(Self { writer, topic: topic.into(), message: PhantomData })
    }

    /// Publishes a message; waits at most 100 ms if the queue of a reliable topic is full.
    ///
    /// # Errors
    /// If the message cannot be serialized, or the queue stayed full.
    pub fn publish(&self, message: &M) -> Result<()> {
        let written = encode(message).and_then(|body| self.writer.write(body, None));
        written.map(drop).map_err(|error| anyhow!("{}: {error}", self.topic))
    }

    /// Number of subscriptions that are matched now.
    pub fn readers(&self) -> usize {
        self.writer.matches().count(self.writer.guid())
    }

    /// Waits until at least `count` subscriptions are matched.
    ///
    /// # Errors
    /// After `deadline` (wall time), saying how many are matched.
    pub async fn wait_for_readers(&self, count: usize, deadline: Duration) -> Result<()> {
        let matched = self.writer.matches().wait(|_| self.readers() >= count);
        tokio::time::timeout(deadline, matched).await.map_err(|_| {
            anyhow!(
                "{}: {} of {count} readers within {:.1} s",
                self.topic,
                self.readers(),
                deadline.as_secs_f64()
            )
        })
    }

    /// The topic's absolute name.
    pub fn topic(&self) -> &str {
        &self.topic
    }
}

/// Receives messages of type `M`.
///
/// ```no_run
/// # use puffer_ros::{NoParams, Node, QosProfile};
/// # use puffer_msgs::std_msgs::msg::Header;
/// # async fn example(node: &Node<NoParams>) -> anyhow::Result<()> {
/// let mut messages = node.subscribe::<Header>("status", QosProfile::Standard)?;
/// while let Some(message) = messages.next().await {
///     tracing::info!("in frame {}", message.frame_id);
/// }
/// # Ok(())
/// # }
/// ```
pub struct Subscription<M> {
    reader: Reader,
    topic: String,
    stop: Stop,
    message: PhantomData<fn() -> M>,
}

impl<M: Interface> Subscription<M> {
    pub(crate) fn new(
        dds: &Participant,
        topic: &str,
        qos: &QosPolicies,
        stop: Stop,
    ) -> Result<Self> {
        let kind = type_name(M::PACKAGE, M::KIND, M::NAME, "");
        let reader = dds.reader(&ros_topic(topic), &kind, qos)?;
        Ok(Self { reader, topic: topic.to_owned(), stop, message: PhantomData })
    }

    /// The next message, or `None` once the node stops. A message that cannot be deserialized is
    /// logged and left out.
    pub async fn next(&mut self) -> Option<M> {
        loop {
            let sample = self.stop.or(self.reader.next()).await?;
            if let Some(message) = self.decode(sample) {
                return Some(message);
            }
        }
    }

    /// The next message.
    ///
    /// # Errors
    /// If nothing came within `deadline` (wall time), or the node stops.
    pub async fn next_within(&mut self, deadline: Duration) -> Result<M> {
        match tokio::time::timeout(deadline, self.next()).await {
            Ok(Some(message)) => Ok(message),
            Ok(None) => bail!("{}: the node stops", self.topic),
            Err(_) => bail!(
                "nothing on {} within {:.1} s ({} publishers matched)",
                self.topic,
                deadline.as_secs_f64(),
                self.writers()
            ),
        }
    }

    /// The next message if it has arrived already.
    pub fn try_next(&mut self) -> Option<M> {
        loop {
            let sample = self.reader.try_next().transpose()?;
            if let Some(message) = self.decode(sample) {
                return Some(message);
            }
        }
    }

    fn decode(&self, sample: Result<ReceivedSample, String>) -> Option<M> {
        sample
            .and_then(|sample| sample.payload.decode())
            .inspect_err(|error| tracing::warn!("{}: message ignored: {error}", self.topic))
            .ok()
    }

    /// Number of publishers that are matched now.
    pub fn writers(&self) -> usize {
        self.reader.matches().count(self.reader.guid())
    }

    /// Waits until at least one publisher is matched.
    ///
    /// # Errors
    /// If there is none within `deadline` (wall time).
    pub async fn wait_for_writer(&self, deadline: Duration) -> Result<()> {
        let matched = self.reader.matches().wait(|_| self.writers() > 0);
        tokio::time::timeout(deadline, matched).await.with_context(|| {
            format!("nobody publishes {} within {:.1} s", self.topic, deadline.as_secs_f64())
        })
    }

    /// The topic's absolute name.
    pub fn topic(&self) -> &str {
        &self.topic
    }
}
