//! Quality of service as rosbag2 notes it with a topic.

use crate::Profile;
use serde::Serialize;

/// rmw's number for "no limit": 2^63 - 1 nanoseconds.
const INFINITE: Time = Time { sec: 9_223_372_036, nsec: 854_775_807 };

/// A profile in rosbag2's notation up to version 8, with rmw's numbers: every distribution reads them.
#[derive(Serialize)]
struct Offered {
    history: u8,
    depth: usize,
    reliability: u8,
    durability: u8,
    deadline: Time,
    lifespan: Time,
    liveliness: u8,
    liveliness_lease_duration: Time,
    avoid_ros_namespace_conventions: bool,
}

#[derive(Clone, Copy, Serialize)]
struct Time {
    sec: u64,
    nsec: u64,
}

/// YAML text of what a publisher of this profile offers.
pub(crate) fn offered(profile: Profile) -> Result<String, String> {
    let (depth, reliability, durability) = match profile {
        Profile::Standard => (10, 1, 2),
        Profile::Sensor => (5, 2, 2),
        Profile::Latched | Profile::LatchedSub => (1, 1, 1),
    };
    let offered = Offered {
        history: 1,
        depth,
        reliability,
        durability,
        deadline: INFINITE,
        lifespan: INFINITE,
        liveliness: 1,
        liveliness_lease_duration: INFINITE,
        avoid_ros_namespace_conventions: false,
    };
    serde_yaml_ng::to_string(&[offered])
        .map(|text| text.trim_end().to_owned())
        .map_err(|e| e.to_string())
}

/// The profile of a topic of which nothing is said: `/tf_static` is latched wherever ROS 2 runs.
pub(crate) fn default_profile(topic: &str) -> Profile {
    if topic == "/tf_static" { Profile::Latched } else { Profile::Standard }
}

/// What was offered, as far as it matters for a publisher that plays the topic; `None` if the text says nothing.
pub(crate) fn profile(text: &str) -> Option<Profile> {
    let profiles: Vec<serde_yaml_ng::Mapping> = serde_yaml_ng::from_str(text).ok()?;
    let first = profiles.first()?;
    let is = |key: &str, number: u64, word: &str| {
        let value = first.get(key);
        value.and_then(|v| v.as_u64()) == Some(number)
            || value.and_then(|v| v.as_str()) == Some(word)
    };
    Some(if is("durability", 1, "transient_local") {
        Profile::Latched
    } else if is("reliability", 2, "best_effort") {
        Profile::Sensor
    } else {
        Profile::Standard
    })
}
