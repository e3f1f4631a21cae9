//! What can go wrong.

use std::time::Duration;

/// Why bulk data could not be sent or read.
#[derive(Debug, thiserror::Error)]
pub enum BulkError {
    /// DDS refused to make an endpoint, or the name is none.
    #[error("topic {topic}: {reason}")]
    Create {
        /// ROS name of the topic.
        topic: String,
        /// What DDS said.
        reason: String,
    },
    /// A message could not be turned into bytes, or bytes into a message.
    #[error("topic {topic}: {reason}")]
    Message {
        /// ROS name of the topic.
        topic: String,
        /// What is wrong with the bytes.
        reason: puffer_msgs::cdr::CdrError,
    },
    /// Readers did not get everything in time.
    #[error(
        "topic {topic}: after {waited:.1?}, {} of {readers} readers lack the newest sample: {}",
        missing.len(),
        missing.join(", ")
    )]
    Missing {
        /// ROS name of the topic.
        topic: String,
        /// How long was waited.
        waited: Duration,
        /// How many readers there are.
        readers: usize,
        /// GUIDs of those that lack something.
        missing: Vec<String>,
    },
    /// Nobody came to read, or fewer than wanted.
    #[error(
        "topic {topic}: {found} of {wanted} readers after {waited:.1?}; are they started, in this ROS_DOMAIN_ID?"
    )]
    Readers {
        /// ROS name of the topic.
        topic: String,
        /// How many were there.
        found: usize,
        /// How many were waited for.
        wanted: usize,
        /// How long was waited.
        waited: Duration,
    },
    /// The transport's thread has ended.
    #[error("topic {topic}: the transport has ended")]
    Closed {
        /// ROS name of the topic.
        topic: String,
    },
}
