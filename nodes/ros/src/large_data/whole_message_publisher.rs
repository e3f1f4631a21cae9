//! Publishing ordinary DDS samples only, for programs that know nothing of tiles.

use super::large_data_error::LargeDataError;
use super::whole_message_writer::{WholeMessageWriter, max_whole_message_bytes};
use puffer_msgs::Interface;
use ros2_client::MessageTypeName;
use rustdds::DomainParticipant;
use std::marker::PhantomData;

/// Publishes messages of type `M` as ordinary DDS samples for those who watch (RViz, rosbag2,
/// scripts). The topic is latched: the newest message waits for the first reader, and stays for
/// readers that come later. A message above [`WholeMessagePublisher::max_bytes`] is not sent, and
/// the log says so.
///
/// It is made by [`Node::whole_message_publisher`](crate::Node::whole_message_publisher).
pub struct WholeMessagePublisher<M> {
    topic: String,
    writer: WholeMessageWriter,
    message: PhantomData<fn(M)>,
}

impl<M: Interface> WholeMessagePublisher<M> {
    pub(crate) fn new(
        participant: &DomainParticipant,
        topic: &str,
    ) -> Result<Self, LargeDataError> {
        let kind = MessageTypeName::new(M::PACKAGE, M::NAME);
        let writer = WholeMessageWriter::new(participant, topic, &kind, true)?;
        Ok(WholeMessagePublisher { topic: topic.to_owned(), writer, message: PhantomData })
    }

    /// The largest serialized message that is sent, in bytes: what this machine's socket buffers
    /// carry (`net.core.rmem_max`).
    pub fn max_bytes(&self) -> usize {
        max_whole_message_bytes()
    }

    /// Publishes a message in place of the one before.
    ///
    /// # Errors
    /// If the message cannot be serialized.
    pub fn publish(&self, message: &M) -> Result<(), LargeDataError> {
        let bytes = puffer_msgs::cdr::to_bytes(message)
            .map_err(|reason| LargeDataError::Message { topic: self.topic.clone(), reason })?;
        self.writer.publish(bytes.into());
        Ok(())
    }
}
