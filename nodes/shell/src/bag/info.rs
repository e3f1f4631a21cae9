//! What is in a bag.

use super::error::BagError;
use super::qos;
use crate::{Profile, Stamp};
use bytes::Bytes;
use puffer_msgs::{Interface, cdr};
use std::sync::Arc;
use std::time::Duration;

/// A topic of a bag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BagTopic {
    /// ROS name.
    pub name: Arc<str>,
    /// Such as "sensor_msgs/msg/PointCloud2".
    pub type_name: Arc<str>,
    /// How its messages are stored: "cdr" in every bag of ROS 2.
    pub encoding: String,
    /// rosbag2's text of the profiles that its publishers offered; may be empty.
    pub offered_qos: String,
    /// Messages.
    pub count: u64,
}

impl BagTopic {
    /// The profile to publish it with when it is played.
    pub fn profile(&self) -> Profile {
        qos::profile(&self.offered_qos).unwrap_or_else(|| qos::default_profile(&self.name))
    }
}

/// An overview of a bag.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BagInfo {
    /// Topics, sorted by name.
    pub topics: Vec<BagTopic>,
    /// Messages of all topics.
    pub count: u64,
    /// When the first message was recorded.
    pub start: Stamp,
    /// When the last message was recorded.
    pub end: Stamp,
    /// What is missing or broken; empty if the bag is whole.
    pub damage: Vec<String>,
}

impl BagInfo {
    /// From the first message to the last.
    pub fn duration(&self) -> Duration {
        let nanos = self.end.nanos().saturating_sub(self.start.nanos());
        Duration::from_nanos(u64::try_from(nanos).unwrap_or_default())
    }
}

/// A message of a bag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BagMessage {
    /// ROS name of its topic.
    pub topic: Arc<str>,
    /// Such as "sensor_msgs/msg/PointCloud2".
    pub type_name: Arc<str>,
    /// The serialized message with its encapsulation header.
    pub bytes: Bytes,
    /// When it was received.
    pub log_time: Stamp,
    /// When it was sent, as far as that was known.
    pub publish_time: Stamp,
}

impl BagMessage {
    /// The message.
    ///
    /// # Errors
    /// [`BagError::Message`] if its type is another one, or the bytes do not fit the type.
    pub fn decode<M: Interface>(&self) -> Result<M, BagError> {
        let wrong = |reason| BagError::Message {
            topic: self.topic.to_string(),
            time: self.log_time,
            reason,
        };
        if *self.type_name != *M::TYPE_NAME {
            return Err(wrong(format!("it holds {}, not {}", self.type_name, M::TYPE_NAME)));
        }
        cdr::from_bytes(&self.bytes).map_err(|e| wrong(e.to_string()))
    }
}
