//! What can go wrong with large data.

use std::time::Duration;

/// Why large data could not be sent or read.
#[derive(Debug, thiserror::Error)]
pub enum LargeDataError {
    /// A DDS endpoint could not be made, or the topic's name is not allowed.
    #[error("topic {topic}: {reason}")]
    Create {
        /// ROS name of the topic.
        topic: String,
        /// What DDS or the operating system said.
        reason: String,
    },
    /// A message could not be serialized, or bytes not be deserialized.
    #[error("topic {topic}: {reason}")]
    Message {
        /// ROS name of the topic.
        topic: String,
        /// What is wrong with the message or its bytes.
        reason: puffer_msgs::cdr::CdrError,
    },
    /// Some readers did not get everything in time.
    #[error(
        "topic {topic}: after {waited:.1?}, {} of {readers} readers lack the newest sample: {}",
        missing.len(),
        missing.join(", ")
    )]
    Missing {
        /// ROS name of the topic.
        topic: String,
        /// How long the writer waited.
        waited: Duration,
        /// How many readers there are.
        readers: usize,
        /// GUIDs of the readers that lack the newest sample.
        missing: Vec<String>,
    },
    /// Fewer readers than wanted came in time.
    #[error(
        "topic {topic}: {found} of {wanted} readers after {waited:.1?}; are they started, in this ROS_DOMAIN_ID?"
    )]
    Readers {
        /// ROS name of the topic.
        topic: String,
        /// How many readers there were.
        found: usize,
        /// How many readers were waited for.
        wanted: usize,
        /// How long the writer waited.
        waited: Duration,
    },
    /// The transport's thread has ended.
    #[error("topic {topic}: the transport has ended")]
    Closed {
        /// ROS name of the topic.
        topic: String,
    },
}
