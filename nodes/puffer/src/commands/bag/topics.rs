//! The topics of the suite, and how they travel.

use puffer_msgs::diagnostic_msgs::msg::DiagnosticArray;
use puffer_msgs::msg::{ModelMesh, ModellingStatus, RegisteredPoses, RegisteredScan};
use puffer_msgs::rcl_interfaces::msg::{Log, ParameterEvent};
use puffer_msgs::rosgraph_msgs::msg::Clock;
use puffer_msgs::sensor_msgs::msg::{JointState, PointCloud2};
use puffer_msgs::std_msgs::msg::String as Text;
use puffer_msgs::tf2_msgs::msg::TFMessage;
use puffer_shell::bag::{BagTopic, TopicRoute};
use puffer_shell::{Interface, Profile};

/// Topics that come from robot and sensor, by the last part of their names; all others are made of these.
const INPUTS: [&str; 6] =
    ["points", "tf", "tf_static", "robot_description", "joint_states", "clock"];
/// Types whose messages are too large for a sample of DDS.
const BULK: [&str; 4] = [
    PointCloud2::TYPE_NAME,
    RegisteredScan::TYPE_NAME,
    RegisteredPoses::TYPE_NAME,
    ModelMesh::TYPE_NAME,
];

/// Everything that the nodes publish for others to read.
pub(crate) fn suite() -> Vec<TopicRoute> {
    let plain = |name: &str, type_name, profile| TopicRoute::plain(name, type_name, profile);
    vec![
        plain("/clock", Clock::TYPE_NAME, Profile::Standard),
        plain("/tf", TFMessage::TYPE_NAME, Profile::Standard),
        plain("/tf_static", TFMessage::TYPE_NAME, Profile::LatchedSub),
        plain("robot_description", Text::TYPE_NAME, Profile::LatchedSub),
        plain("joint_states", JointState::TYPE_NAME, Profile::Standard),
        TopicRoute::bulk("points", PointCloud2::TYPE_NAME, false),
        TopicRoute::bulk("registered_scan", RegisteredScan::TYPE_NAME, false),
        TopicRoute::bulk("registered_poses", RegisteredPoses::TYPE_NAME, true),
        TopicRoute::bulk("filtered_cloud", PointCloud2::TYPE_NAME, true),
        TopicRoute::bulk("model_mesh", ModelMesh::TYPE_NAME, true),
        plain("modelling_status", ModellingStatus::TYPE_NAME, Profile::Standard),
        plain("/rosout", Log::TYPE_NAME, Profile::LatchedSub),
        plain("/diagnostics", DiagnosticArray::TYPE_NAME, Profile::Standard),
        plain("/parameter_events", ParameterEvent::TYPE_NAME, Profile::Standard),
    ]
}

/// Whether a topic of a bag comes from robot or sensor.
pub(super) fn is_input(topic: &BagTopic) -> bool {
    topic.name.rsplit('/').next().is_some_and(|last| INPUTS.contains(&last))
}

/// A topic that the user names: what the suite knows of it, or else what its type demands.
pub(super) fn named(name: &str, type_name: &str) -> TopicRoute {
    let bare = |name: &str| name.trim_start_matches('/').to_owned();
    let known = suite().into_iter().find(|t| bare(&t.topic) == bare(name));
    match known.filter(|t| t.type_name == type_name) {
        Some(known) => TopicRoute { topic: name.to_owned(), ..known },
        None if BULK.contains(&type_name) => TopicRoute::bulk(name, type_name, false),
        None => TopicRoute::plain(name, type_name, Profile::Standard),
    }
}

/// How a topic of a bag is played.
pub(super) fn played(topic: &BagTopic) -> TopicRoute {
    let latched = topic.profile() == Profile::Latched;
    if BULK.contains(&&*topic.type_name) {
        TopicRoute::bulk(&topic.name, &topic.type_name, latched)
    } else {
        TopicRoute::of(topic)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_shell::bag::Route;

    #[test]
    fn only_what_robot_and_sensor_say_is_input() {
        let topic = |name: &str, type_name: &str| BagTopic {
            name: name.into(),
            type_name: type_name.into(),
            encoding: "cdr".into(),
            offered_qos: String::new(),
            count: 1,
        };
        let inputs = suite().into_iter().map(|t| topic(&t.topic, &t.type_name)).filter(is_input);
        assert_eq!(inputs.count(), INPUTS.len());
        assert!(is_input(&topic("/cell/points", PointCloud2::TYPE_NAME)));
        assert!(!is_input(&topic("/registered_scan", RegisteredScan::TYPE_NAME)));
        let route = played(&topic("/cell/points", PointCloud2::TYPE_NAME)).route;
        assert_eq!(route, Route::Bulk { latched: false });
    }

    #[test]
    fn a_named_topic_travels_as_the_suite_sends_it() {
        let route = |name, type_name| named(name, type_name).route;
        assert_eq!(route("/model_mesh", ModelMesh::TYPE_NAME), Route::Bulk { latched: true });
        assert_eq!(route("camera", PointCloud2::TYPE_NAME), Route::Bulk { latched: false });
        assert_eq!(route("tf_static", TFMessage::TYPE_NAME), Route::Plain(Profile::LatchedSub));
        assert_eq!(route("/chatter", Text::TYPE_NAME), Route::Plain(Profile::Standard));
    }
}
