//! What a bag holds: topics, and messages.

use super::bag_error::BagError;
use super::offered_qos;
use crate::{QosProfile, Stamp};
use bytes::Bytes;
use puffer_msgs::{Interface, cdr};
use std::sync::Arc;
use std::time::Duration;

/// A topic of a bag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BagTopic {
    /// Absolute ROS name.
    pub name: Arc<str>,
    /// Type of its messages, such as "sensor_msgs/msg/PointCloud2".
    pub type_name: Arc<str>,
    /// Encoding of its messages: "cdr" in every bag of ROS 2.
    pub encoding: String,
    /// The QoS profiles that its publishers offered, as rosbag2's YAML text; may be empty.
    pub offered_qos: String,
    /// Number of messages.
    pub count: u64,
}

impl BagTopic {
    /// The QoS profile to publish the topic with when the bag is played.
    pub fn profile(&self) -> QosProfile {
        offered_qos::from_yaml(&self.offered_qos)
            .unwrap_or_else(|| offered_qos::default_profile(&self.name))
    }
}

/// An overview of a bag.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BagInfo {
    /// The topics, sorted by name.
    pub topics: Vec<BagTopic>,
    /// Number of messages of all topics.
    pub count: u64,
    /// Log time of the first message.
    pub start: Stamp,
    /// Log time of the last message.
    pub end: Stamp,
    /// Descriptions of what is missing or broken; empty if the bag is complete.
    pub damage: Vec<String>,
}

impl BagInfo {
    /// The time from the first message to the last.
    pub fn duration(&self) -> Duration {
        let nanos = self.end.nanos().saturating_sub(self.start.nanos());
        Duration::from_nanos(u64::try_from(nanos).unwrap_or_default())
    }
}

/// A message of a bag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BagMessage {
    /// Absolute ROS name of its topic.
    pub topic: Arc<str>,
    /// Type of its messages, such as "sensor_msgs/msg/PointCloud2".
    pub type_name: Arc<str>,
    /// The serialized message with its encapsulation header.
    pub bytes: Bytes,
    /// When the recorder received it.
    pub log_time: Stamp,
    /// When it was published, as far as the recorder knew.
    pub publish_time: Stamp,
}

impl BagMessage {
    /// The deserialized message.
    ///
    /// # Errors
    /// [`BagError::Message`] if it is of another type, or the bytes do not fit the type.
    pub fn decode<M: Interface>(&self) -> Result<M, BagError> {
        if *self.type_name != *M::TYPE_NAME {
            let reason = format!("it holds {}, not {}", self.type_name, M::TYPE_NAME);
            return Err(self.decode_error(reason));
        }
        cdr::from_bytes(&self.bytes).map_err(|e| self.decode_error(e.to_string()))
    }

    fn decode_error(&self, reason: String) -> BagError {
        BagError::Message { topic: self.topic.to_string(), time: self.log_time, reason }
    }
}
