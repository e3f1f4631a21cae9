//! The `metadata.yaml` of rosbag2: it is read from a folder, and its text is written into the file
//! itself.

use super::bag_info::BagTopic;
use crate::Stamp;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Version of the format: the last one in which QoS profiles are texts of numbers.
const METADATA_VERSION: u32 = 8;
/// ROS distribution whose interfaces puffer uses.
const ROS_DISTRO: &str = "jazzy";

/// What is read of a folder's `metadata.yaml`.
#[derive(Deserialize)]
pub(crate) struct MetadataFile {
    pub rosbag2_bagfile_information: FolderInformation,
}

#[derive(Deserialize)]
pub(crate) struct FolderInformation {
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
    let information = Information {
        version: METADATA_VERSION,
        storage_identifier: "mcap",
        duration,
        starting_time,
        message_count,
        topics_with_message_count: topics.iter().map(topic_count).collect(),
        compression_format: "",
        compression_mode: "",
        relative_file_paths: [file],
        files: [FileInformation { path: file, starting_time, duration, message_count }],
        custom_data: BTreeMap::new(),
        ros_distro: ROS_DISTRO,
    };
    serde_yaml_ng::to_string(&information).map_err(|e| e.to_string())
}

/// The entry of one topic.
fn topic_count(topic: &BagTopic) -> TopicCount<'_> {
    TopicCount {
        topic_metadata: TopicMetadata {
            name: &topic.name,
            r#type: &topic.type_name,
            serialization_format: &topic.encoding,
            offered_qos_profiles: &topic.offered_qos,
            type_description_hash: "",
        },
        message_count: topic.count,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topic(name: &str, count: u64) -> BagTopic {
        BagTopic {
            name: name.into(),
            type_name: "rosgraph_msgs/msg/Clock".into(),
            encoding: "cdr".into(),
            offered_qos: "- {}".into(),
            count,
        }
    }

    #[test]
    fn counts_and_times_are_those_of_the_bag() {
        let range = Some((Stamp::from_nanos(5), Stamp::from_nanos(12)));
        let text = serialized_metadata("run.mcap", &[topic("/a", 3), topic("/b", 4)], range);
        let value: serde_json::Value = serde_yaml_ng::from_str(&text.unwrap()).unwrap();
        assert_eq!(value["version"], METADATA_VERSION);
        assert_eq!(value["message_count"], 7);
        assert_eq!(value["duration"]["nanoseconds"], 7);
        assert_eq!(value["starting_time"]["nanoseconds_since_epoch"], 5);
        assert_eq!(value["relative_file_paths"], serde_json::json!(["run.mcap"]));
        let second = &value["topics_with_message_count"][1];
        assert_eq!(second["message_count"], 4);
        assert_eq!(second["topic_metadata"]["name"], "/b");
        assert_eq!(second["topic_metadata"]["type"], "rosgraph_msgs/msg/Clock");
        assert_eq!(second["topic_metadata"]["offered_qos_profiles"], "- {}");
    }

    #[test]
    fn an_empty_bag_begins_and_ends_at_zero() {
        let text = serialized_metadata("run.mcap", &[], None).unwrap();
        let value: serde_json::Value = serde_yaml_ng::from_str(&text).unwrap();
        assert_eq!(
            (&value["message_count"], &value["duration"]["nanoseconds"]),
            (&0.into(), &0.into())
        );
    }

    #[test]
    fn a_folder_need_not_tell_its_compression() {
        let text =
            "rosbag2_bagfile_information: {storage_identifier: mcap, relative_file_paths: [a]}";
        let file: MetadataFile = serde_yaml_ng::from_str(text).unwrap();
        let information = file.rosbag2_bagfile_information;
        assert_eq!(information.compression_mode, "");
        assert_eq!(information.relative_file_paths, ["a"]);
        assert!(serde_yaml_ng::from_str::<MetadataFile>("a: 1").is_err());
    }
}
