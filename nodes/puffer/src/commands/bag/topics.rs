//! The topics of the suite, and how they travel.

use puffer_msgs::diagnostic_msgs::msg::DiagnosticArray;
use puffer_msgs::msg::{ModelMesh, ModellingStatus, RegisteredPoses, RegisteredScan};
use puffer_msgs::rcl_interfaces::msg::{Log, ParameterEvent};
use puffer_msgs::rosgraph_msgs::msg::Clock;
use puffer_msgs::sensor_msgs::msg::{JointState, PointCloud2};
use puffer_msgs::std_msgs::msg::String as Text;
use puffer_msgs::tf2_msgs::msg::TFMessage;
use puffer_ros::bag::{BagTopic, TopicRoute};
use puffer_ros::{Interface, QosProfile};

/// Topics that come from robot and sensor, by the last part of their names; all others are made of
/// these.
const INPUT_TOPICS: [&str; 6] =
    ["points", "tf", "tf_static", "robot_description", "joint_states", "clock"];
/// Types whose messages are too large for a sample of DDS.
const BULK_TYPES: [&str; 4] = [
    PointCloud2::TYPE_NAME,
    RegisteredScan::TYPE_NAME,
    RegisteredPoses::TYPE_NAME,
    ModelMesh::TYPE_NAME,
];

/// Everything that the nodes publish for others to read.
pub(crate) fn suite_routes() -> Vec<TopicRoute> {
    vec![
        TopicRoute::samples("/clock", Clock::TYPE_NAME, QosProfile::Standard),
        TopicRoute::samples("/tf", TFMessage::TYPE_NAME, QosProfile::Standard),
        TopicRoute::samples("/tf_static", TFMessage::TYPE_NAME, QosProfile::LatchedSub),
        TopicRoute::samples("robot_description", Text::TYPE_NAME, QosProfile::LatchedSub),
        TopicRoute::samples("joint_states", JointState::TYPE_NAME, QosProfile::Standard),
        TopicRoute::tiles("points", PointCloud2::TYPE_NAME, false),
        TopicRoute::tiles("registered_scan", RegisteredScan::TYPE_NAME, false),
        TopicRoute::tiles("registered_poses", RegisteredPoses::TYPE_NAME, true),
        TopicRoute::tiles("filtered_cloud", PointCloud2::TYPE_NAME, true),
        TopicRoute::tiles("model_mesh", ModelMesh::TYPE_NAME, true),
        TopicRoute::samples("modelling_status", ModellingStatus::TYPE_NAME, QosProfile::Standard),
        TopicRoute::samples("/rosout", Log::TYPE_NAME, QosProfile::LatchedSub),
        TopicRoute::samples("/diagnostics", DiagnosticArray::TYPE_NAME, QosProfile::Standard),
        TopicRoute::samples("/parameter_events", ParameterEvent::TYPE_NAME, QosProfile::Standard),
    ]
}

/// Whether a topic of a bag comes from robot or sensor.
pub(super) fn is_input(topic: &BagTopic) -> bool {
    topic.name.rsplit('/').next().is_some_and(|last| INPUT_TOPICS.contains(&last))
}

/// A topic that the user names: what the suite knows of it, or else what its type demands.
pub(super) fn route_of_name(name: &str, type_name: &str) -> TopicRoute {
    let bare_name = name.trim_start_matches('/');
    let known = suite_routes().into_iter().find(|t| t.topic.trim_start_matches('/') == bare_name);
    match known.filter(|t| t.type_name == type_name) {
        Some(known) => TopicRoute { topic: name.to_owned(), ..known },
        None if BULK_TYPES.contains(&type_name) => TopicRoute::tiles(name, type_name, false),
        None => TopicRoute::samples(name, type_name, QosProfile::Standard),
    }
}

/// How a topic of a bag is played.
pub(super) fn playback_route(topic: &BagTopic) -> TopicRoute {
    let latched = topic.profile() == QosProfile::Latched;
    if BULK_TYPES.contains(&&*topic.type_name) {
        TopicRoute::tiles(&topic.name, &topic.type_name, latched)
    } else {
        TopicRoute::from_bag_topic(topic)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_ros::bag::Route;

    fn topic(name: &str, type_name: &str) -> BagTopic {
        BagTopic {
            name: name.into(),
            type_name: type_name.into(),
            encoding: "cdr".into(),
            offered_qos: String::new(),
            count: 1,
        }
    }

    fn route(name: &str, type_name: &str) -> Route {
        route_of_name(name, type_name).route
    }

    #[test]
    fn only_what_robot_and_sensor_say_is_input() {
        let inputs =
            suite_routes().into_iter().map(|t| topic(&t.topic, &t.type_name)).filter(is_input);
        assert_eq!(inputs.count(), INPUT_TOPICS.len());
        assert!(is_input(&topic("/cell/points", PointCloud2::TYPE_NAME)));
        assert!(!is_input(&topic("/registered_scan", RegisteredScan::TYPE_NAME)));
        let route = playback_route(&topic("/cell/points", PointCloud2::TYPE_NAME)).route;
        assert_eq!(route, Route::Tiles { latched: false });
    }

    #[test]
    fn a_named_topic_travels_as_the_suite_sends_it() {
        assert_eq!(route("/model_mesh", ModelMesh::TYPE_NAME), Route::Tiles { latched: true });
        assert_eq!(route("camera", PointCloud2::TYPE_NAME), Route::Tiles { latched: false });
        assert_eq!(
            route("tf_static", TFMessage::TYPE_NAME),
            Route::Samples(QosProfile::LatchedSub)
        );
        assert_eq!(route("/chatter", Text::TYPE_NAME), Route::Samples(QosProfile::Standard));
    }
}
