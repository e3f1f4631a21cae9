//! Where what lies in a file.

use super::info::BagTopic;
use mcap::Channel;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A piece of a file that holds messages: a chunk, or messages in a row that are in no chunk.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Where it begins.
    pub at: u64,
    /// How long it is, bytes.
    pub length: u64,
    /// Earliest and latest time in it, nanoseconds.
    pub start: u64,
    pub end: u64,
}

/// The index of a file.
#[derive(Debug, Default)]
pub(crate) struct Index {
    pub path: PathBuf,
    /// By the number of the channel.
    pub topics: BTreeMap<u16, BagTopic>,
    pub blocks: Vec<Block>,
    pub metadata: Vec<(String, BTreeMap<String, String>)>,
    /// What is missing or broken, for people.
    pub damage: Vec<String>,
}

pub(crate) fn topic(channel: &Channel<'_>) -> BagTopic {
    BagTopic {
        name: channel.topic.as_str().into(),
        type_name: channel.schema.as_ref().map_or("", |schema| &schema.name).into(),
        encoding: channel.message_encoding.clone(),
        offered_qos: channel.metadata.get("offered_qos_profiles").cloned().unwrap_or_default(),
        count: 0,
    }
}
