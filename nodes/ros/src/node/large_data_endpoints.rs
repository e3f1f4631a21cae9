//! Publishers and subscriptions of large data.

use super::Node;
use crate::Interface;
use crate::large_data::{
    Delivery, LargeDataPublisher, LargeDataSubscription, Retention, WholeMessagePublisher,
};
use anyhow::Result;
use puffer_core::params::Parameters;
use ros2_client::MessageTypeName;

impl<P: Parameters> Node<P> {
    /// A publisher of messages of any size, which travel in tiles; see
    /// [`large_data`](crate::large_data).
    ///
    /// # Errors
    /// If the name is not allowed, or DDS makes no endpoints.
    pub fn large_data_publisher(
        &self,
        topic: &str,
        retention: Retention,
    ) -> Result<LargeDataPublisher> {
        let topic = self.resolve(topic)?;
        Ok(self
            .inner
            .dds
            .with_ros2_node(|node| LargeDataPublisher::new(node, &topic, retention))??)
    }

    /// A subscription to what a [`LargeDataPublisher`] sends in tiles.
    ///
    /// # Errors
    /// If the name is not allowed, or DDS makes no endpoints.
    pub fn large_data_subscribe<M>(
        &self,
        topic: &str,
        delivery: Delivery,
    ) -> Result<LargeDataSubscription<M>> {
        let topic = self.resolve(topic)?;
        Ok(self
            .inner
            .dds
            .with_ros2_node(|node| LargeDataSubscription::new(node, &topic, delivery))??)
    }

    /// As [`Node::large_data_publisher`]; besides it publishes the messages, of type `M`, as
    /// ordinary samples for readers that know nothing of tiles (RViz, rosbag2, scripts): only while
    /// there are any, and only what the host's socket buffers carry.
    ///
    /// # Errors
    /// If the name is not allowed, or DDS makes no endpoints.
    pub fn large_data_publisher_for_any_reader<M: Interface>(
        &self,
        topic: &str,
        retention: Retention,
    ) -> Result<LargeDataPublisher> {
        let publisher = self.large_data_publisher(topic, retention)?;
        let participant = self.inner.dds.dds_participant();
        let kind = MessageTypeName::new(M::PACKAGE, M::NAME);
        Ok(publisher.with_whole_messages(participant, &kind, retention == Retention::Latched)?)
    }

    /// As [`Node::large_data_subscribe`]; besides it receives messages that come as ordinary
    /// samples from writers that know nothing of tiles (a sensor's driver, scripts).
    ///
    /// # Errors
    /// If the name is not allowed, or DDS makes no endpoints.
    pub fn large_data_subscribe_from_any_writer<M: Interface>(
        &self,
        topic: &str,
        delivery: Delivery,
    ) -> Result<LargeDataSubscription<M>> {
        let subscription = self.large_data_subscribe::<M>(topic, delivery)?;
        let participant = self.inner.dds.dds_participant();
        let kind = MessageTypeName::new(M::PACKAGE, M::NAME);
        Ok(subscription.with_whole_messages(participant, &kind)?)
    }

    /// A latched publisher of ordinary samples for those who watch (RViz, rosbag2, scripts), which
    /// sends only what the host's socket buffers carry.
    ///
    /// # Errors
    /// If the name is not allowed, or DDS makes no endpoints.
    pub fn whole_message_publisher<M: Interface>(
        &self,
        topic: &str,
    ) -> Result<WholeMessagePublisher<M>> {
        let topic = self.resolve(topic)?;
        Ok(WholeMessagePublisher::new(self.inner.dds.dds_participant(), &topic)?)
    }
}
