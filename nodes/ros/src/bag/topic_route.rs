//! Which topics are recorded or played, and how.

use super::bag_info::BagTopic;
use crate::{QosProfile, dds};
use anyhow::{Result, anyhow};
use rustdds::QosPolicies;
use rustdds::policy::Durability;

/// Number of samples that DDS keeps of a topic that is recorded or played: bursts are longer than
/// in a node that takes only what it needs.
const RECORDING_QOS_DEPTH: i32 = 1000;

/// How the messages of a topic travel over DDS.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Route {
    /// As ordinary samples with this QoS profile.
    Samples(QosProfile),
    /// In tiles; see [`large_data`](crate::large_data).
    Tiles {
        /// Whether the newest message stays for readers that come later.
        latched: bool,
    },
}

/// A topic that is recorded or played.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TopicRoute {
    /// ROS name; it is resolved as every name of the node.
    pub topic: String,
    /// Type of its messages, such as "sensor_msgs/msg/PointCloud2".
    pub type_name: String,
    /// How its messages travel.
    pub route: Route,
}

impl TopicRoute {
    /// A topic of ordinary samples.
    pub fn samples(topic: &str, type_name: &str, profile: QosProfile) -> TopicRoute {
        let (topic, type_name) = (topic.to_owned(), type_name.to_owned());
        TopicRoute { topic, type_name, route: Route::Samples(profile) }
    }

    /// A large-data topic, whose messages travel in tiles.
    pub fn tiles(topic: &str, type_name: &str, latched: bool) -> TopicRoute {
        let (topic, type_name) = (topic.to_owned(), type_name.to_owned());
        TopicRoute { topic, type_name, route: Route::Tiles { latched } }
    }

    /// A topic of a bag, as ordinary samples with the QoS profile that was recorded.
    pub fn from_bag_topic(topic: &BagTopic) -> TopicRoute {
        TopicRoute::samples(&topic.name, &topic.type_name, topic.profile())
    }

    /// The QoS profile that a bag stores for the topic.
    pub fn profile(&self) -> QosProfile {
        match self.route {
            Route::Samples(profile) => profile,
            Route::Tiles { latched: true } => QosProfile::Latched,
            Route::Tiles { latched: false } => QosProfile::Standard,
        }
    }

    /// DDS name of the topic's type.
    pub(crate) fn dds_type(&self) -> Result<String> {
        let parts: Vec<&str> = self.type_name.split('/').collect();
        match parts[..] {
            [package, kind, name] => Ok(dds::type_name(package, kind, name, "")),
            _ => Err(anyhow!(
                "topic {}: type `{}` is none; types are such as sensor_msgs/msg/PointCloud2",
                self.topic,
                self.type_name
            )),
        }
    }
}

/// The QoS that a recorder requests and a player offers.
pub(crate) fn recording_policies(profile: QosProfile) -> QosPolicies {
    match profile {
        QosProfile::Standard => crate::qos::build(true, Durability::Volatile, RECORDING_QOS_DEPTH),
        QosProfile::Sensor => crate::qos::build(false, Durability::Volatile, RECORDING_QOS_DEPTH),
        QosProfile::Latched | QosProfile::LatchedSub => {
            crate::qos::build(true, Durability::TransientLocal, RECORDING_QOS_DEPTH)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_type_has_three_parts() {
        let route = TopicRoute::samples("/clock", "rosgraph_msgs/msg/Clock", QosProfile::Standard);
        assert_eq!(route.dds_type().unwrap(), "rosgraph_msgs::msg::dds_::Clock_");
        for type_name in ["", "Clock", "rosgraph_msgs/Clock", "a/b/c/d"] {
            let error = TopicRoute::tiles("/clock", type_name, true).dds_type().unwrap_err();
            assert!(error.to_string().contains("types are such as"), "{error}");
        }
    }

    #[test]
    fn a_bag_stores_latched_tiles_as_a_latched_topic() {
        assert_eq!(TopicRoute::tiles("/a", "b", true).profile(), QosProfile::Latched);
        assert_eq!(TopicRoute::tiles("/a", "b", false).profile(), QosProfile::Standard);
        let sensor = TopicRoute::samples("/a", "b", QosProfile::Sensor);
        assert_eq!(sensor.profile(), QosProfile::Sensor);
    }
}
