//! What a file of a bag holds, and where.

use super::bag_info::BagTopic;
use mcap::Channel;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A part of a file that holds messages: a chunk, or messages in a row that are in no chunk.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Position of its first byte in the file.
    pub at: u64,
    /// Length in bytes.
    pub length: u64,
    /// Earliest log time in it, nanoseconds.
    pub start: u64,
    /// Latest log time in it, nanoseconds.
    pub end: u64,
}

/// The index of a file.
#[derive(Debug, Default)]
pub(crate) struct FileIndex {
    pub path: PathBuf,
    /// The topics by the numbers of their channels.
    pub topics: BTreeMap<u16, BagTopic>,
    /// In the order of the file.
    pub blocks: Vec<Block>,
    /// Metadata records: name and values.
    pub metadata: Vec<(String, BTreeMap<String, String>)>,
    /// Descriptions of what is missing or broken.
    pub damage: Vec<String>,
}

/// The topic of a channel, with no messages counted.
pub(crate) fn topic_from_channel(channel: &Channel<'_>) -> BagTopic {
    BagTopic {
        name: channel.topic.as_str().into(),
        type_name: channel.schema.as_ref().map_or("", |schema| &schema.name).into(),
        encoding: channel.message_encoding.clone(),
        offered_qos: channel.metadata.get("offered_qos_profiles").cloned().unwrap_or_default(),
        count: 0,
    }
}
