//! The `metadata.yaml` of rosbag2: read from a folder, and written into the file itself.

use super::info::BagTopic;
use crate::Stamp;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Version of the format: the last in which profiles are texts of numbers.
const VERSION: u32 = 8;
/// Distribution whose interfaces puffer uses.
const DISTRIBUTION: &str = "jazzy";

/// What is read of a folder's `metadata.yaml`.
#[derive(Deserialize)]
pub(crate) struct MetadataFile {
    pub rosbag2_bagfile_information: Folder,
}

#[derive(Deserialize)]
pub(crate) struct Folder {
    pub storage_identifier: String,
    pub relative_file_paths: Vec<String>,
    #[serde(default)]
    pub compression_mode: String,
}

#[derive(Serialize)]
struct Information<'a> {
    version: u32,
    storage_identifier: &'static str,
    duration: Nanoseconds,
    starting_time: SinceEpoch,
    message_count: u64,
    topics_with_message_count: Vec<TopicCount<'a>>,
    compression_format: &'static str,
    compression_mode: &'static str,
    relative_file_paths: [&'a str; 1],
    files: [FileInformation<'a>; 1],
    custom_data: BTreeMap<String, String>,
    ros_distro: &'static str,
}

#[derive(Clone, Copy, Serialize)]
struct Nanoseconds {
    nanoseconds: i64,
}

#[derive(Clone, Copy, Serialize)]
struct SinceEpoch {
    nanoseconds_since_epoch: i64,
}

#[derive(Serialize)]
struct TopicCount<'a> {
    topic_metadata: TopicMetadata<'a>,
    message_count: u64,
}

#[derive(Serialize)]
struct TopicMetadata<'a> {
    name: &'a str,
    r#type: &'a str,
    serialization_format: &'a str,
    offered_qos_profiles: &'a str,
    type_description_hash: &'static str,
}

#[derive(Serialize)]
struct FileInformation<'a> {
    path: &'a str,
    starting_time: SinceEpoch,
    duration: Nanoseconds,
    message_count: u64,
}

/// What rosbag2 expects in the metadata record `rosbag2` under `serialized_metadata`.
pub(crate) fn serialized_metadata(
    file: &str,
    topics: &[BagTopic],
    range: Option<(Stamp, Stamp)>,
) -> Result<String, String> {
    let (start, end) = range.unwrap_or_default();
    let duration = Nanoseconds { nanoseconds: end.nanos() - start.nanos() };
    let starting_time = SinceEpoch { nanoseconds_since_epoch: start.nanos() };
    let message_count = topics.iter().map(|topic| topic.count).sum();
    let topic = |topic| {
        let BagTopic { name, type_name, encoding, offered_qos, count, .. }: &BagTopic = topic;
        TopicCount {
            topic_metadata: TopicMetadata {
                name,
                r#type: type_name,
                serialization_format: encoding,
                offered_qos_profiles: offered_qos,
                type_description_hash: "",
            },
            message_count: *count,
        }
    };
    let information = Information {
        version: VERSION,
        storage_identifier: "mcap",
        duration,
        starting_time,
        message_count,
        topics_with_message_count: topics.iter().map(topic).collect(),
        compression_format: "",
        compression_mode: "",
        relative_file_paths: [file],
        files: [FileInformation { path: file, starting_time, duration, message_count }],
        custom_data: BTreeMap::new(),
        ros_distro: DISTRIBUTION,
    };
    serde_yaml_ng::to_string(&information).map_err(|e| e.to_string())
}
