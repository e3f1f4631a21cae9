//! Topics of whole messages only, for those who watch.

use super::error::BulkError;
use super::whole::{Whole, largest_message};
use puffer_msgs::Interface;
use ros2_client::MessageTypeName;
use rustdds::DomainParticipant;
use std::marker::PhantomData;

/// Publishes messages of type `M` whole and latched, for RViz and scripts: the newest one waits for the first reader,
/// and stays for those that come later. What exceeds [`WholePublisher::most_bytes`] is not sent, and the log says so.
pub struct WholePublisher<M> {
    topic: String,
    whole: Whole,
    message: PhantomData<fn(M)>,
}

impl<M: Interface> WholePublisher<M> {
    pub(crate) fn new(participant: &DomainParticipant, topic: &str) -> Result<Self, BulkError> {
        let kind = MessageTypeName::new(M::PACKAGE, M::NAME);
        let whole = Whole::new(participant, topic, &kind, true)?;
        Ok(WholePublisher { topic: topic.to_owned(), whole, message: PhantomData })
    }

    /// Bytes that a message may have: what this machine's socket buffers carry (`net.core.rmem_max`).
    pub fn most_bytes(&self) -> usize {
        largest_message()
    }

    /// Publishes a message in place of the one before.
    ///
    /// # Errors
    /// It has no CDR.
    pub fn publish(&self, message: &M) -> Result<(), BulkError> {
        let bytes = puffer_msgs::cdr::to_bytes(message)
            .map_err(|reason| BulkError::Message { topic: self.topic.clone(), reason })?;
        self.whole.publish(bytes.into());
        Ok(())
    }
}
