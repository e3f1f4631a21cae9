//! Which topics are recorded or played, and how.

use super::info::BagTopic;
use crate::{Profile, dds};
use anyhow::{Result, anyhow};
use rustdds::QosPolicies;
use rustdds::policy::Durability;

/// Samples that DDS keeps of a topic that is recorded or played: bursts are longer than in a node that takes what it
/// needs.
const DEPTH: i32 = 1000;

/// How the messages of a topic travel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Route {
    /// As samples of DDS with this profile.
    Plain(Profile),
    /// In tiles; see [`crate::bulk`]. Latched: the newest message stays for readers that come later.
    Bulk {
        /// Whether it stays.
        latched: bool,
    },
}

/// A topic that is recorded or played.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TopicRoute {
    /// ROS name, resolved as every name of the node.
    pub topic: String,
    /// Such as "sensor_msgs/msg/PointCloud2".
    pub type_name: String,
    /// How it travels.
    pub route: Route,
}

impl TopicRoute {
    /// A topic of samples.
    pub fn plain(topic: &str, type_name: &str, profile: Profile) -> TopicRoute {
        let (topic, type_name) = (topic.to_owned(), type_name.to_owned());
        TopicRoute { topic, type_name, route: Route::Plain(profile) }
    }

    /// A topic of tiles.
    pub fn bulk(topic: &str, type_name: &str, latched: bool) -> TopicRoute {
        let (topic, type_name) = (topic.to_owned(), type_name.to_owned());
        TopicRoute { topic, type_name, route: Route::Bulk { latched } }
    }

    /// A topic of a bag, as samples with the profile that was recorded.
    pub fn of(topic: &BagTopic) -> TopicRoute {
        TopicRoute::plain(&topic.name, &topic.type_name, topic.profile())
    }

    /// The profile that a bag notes.
    pub fn profile(&self) -> Profile {
        match self.route {
            Route::Plain(profile) => profile,
            Route::Bulk { latched: true } => Profile::Latched,
            Route::Bulk { latched: false } => Profile::Standard,
        }
    }

    /// Its type as DDS has it.
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

/// What a recorder asks for and a player offers.
pub(crate) fn policies(profile: Profile) -> QosPolicies {
    match profile {
        Profile::Standard => crate::qos::build(true, Durability::Volatile, DEPTH),
        Profile::Sensor => crate::qos::build(false, Durability::Volatile, DEPTH),
        Profile::Latched | Profile::LatchedSub => {
            crate::qos::build(true, Durability::TransientLocal, DEPTH)
        }
    }
}
