//! Samples of any size.

use super::Node;
use crate::Interface;
use crate::bulk::{BulkPublisher, BulkSubscription, Delivery, Mode, WholePublisher};
use anyhow::Result;
use puffer_core::params::Parameters;
use ros2_client::MessageTypeName;

impl<P: Parameters> Node<P> {
    /// A publisher of samples of any size; `topic` as in [`Node::publisher`].
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn bulk_publisher(&self, topic: &str, mode: Mode) -> Result<BulkPublisher> {
        let topic = self.resolve(topic)?;
        Ok(self.inner.dds.with_ros2_node(|node| BulkPublisher::new(node, &topic, mode))??)
    }

    /// A subscription to what a [`BulkPublisher`] sends; `topic` as in [`Node::publisher`].
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn bulk_subscribe<M>(
        &self,
        topic: &str,
        delivery: Delivery,
    ) -> Result<BulkSubscription<M>> {
        let topic = self.resolve(topic)?;
        Ok(self
            .inner
            .dds
            .with_ros2_node(|node| BulkSubscription::new(node, &topic, delivery))??)
    }

    /// As [`Node::bulk_publisher`], and whole messages of type `M` for readers that know nothing of tiles (RViz,
    /// rosbag2, scripts): only while there are any, and only what the host's socket buffers carry.
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn bulk_publisher_for_all<M: Interface>(
        &self,
        topic: &str,
        mode: Mode,
    ) -> Result<BulkPublisher> {
        let publisher = self.bulk_publisher(topic, mode)?;
        let participant = self.inner.dds.participant();
        let kind = MessageTypeName::new(M::PACKAGE, M::NAME);
        Ok(publisher.with_whole_messages(participant, &kind, mode == Mode::Latched)?)
    }

    /// As [`Node::bulk_subscribe`], and whole messages from writers that know nothing of tiles (a sensor's driver,
    /// scripts).
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn bulk_subscribe_from_all<M: Interface>(
        &self,
        topic: &str,
        delivery: Delivery,
    ) -> Result<BulkSubscription<M>> {
        let subscription = self.bulk_subscribe::<M>(topic, delivery)?;
        let participant = self.inner.dds.participant();
        let kind = MessageTypeName::new(M::PACKAGE, M::NAME);
        Ok(subscription.with_plain_messages(participant, &kind)?)
    }

    /// A latched publisher of whole messages, for those who watch (RViz, rosbag2, scripts): only what the host's socket
    /// buffers carry.
    ///
    /// # Errors
    /// A name that is not allowed, or no resources.
    pub fn whole_publisher<M: Interface>(&self, topic: &str) -> Result<WholePublisher<M>> {
        let topic = self.resolve(topic)?;
        Ok(WholePublisher::new(self.inner.dds.participant(), &topic)?)
    }
}
