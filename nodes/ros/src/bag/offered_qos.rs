//! The offered QoS profiles of a topic, as rosbag2 stores them.

use crate::QosProfile;
use serde::Serialize;

/// rmw's duration "no limit": 2^63 - 1 nanoseconds.
const INFINITE_DURATION: RmwDuration = RmwDuration { sec: 9_223_372_036, nsec: 854_775_807 };

/// A profile in rosbag2's notation up to version 8, with rmw's numbers, which every distribution
/// reads.
#[derive(Serialize)]
struct OfferedProfile {
    history: u8,
    depth: usize,
    reliability: u8,
    durability: u8,
    deadline: RmwDuration,
    lifespan: RmwDuration,
    liveliness: u8,
    liveliness_lease_duration: RmwDuration,
    avoid_ros_namespace_conventions: bool,
}

#[derive(Clone, Copy, Serialize)]
struct RmwDuration {
    sec: u64,
    nsec: u64,
}

/// The YAML text of what a publisher of this profile offers.
pub(crate) fn to_yaml(profile: QosProfile) -> Result<String, String> {
    let (depth, reliability, durability) = match profile {
        QosProfile::Standard => (10, 1, 2),
        QosProfile::Sensor => (5, 2, 2),
        QosProfile::Latched | QosProfile::LatchedSub => (1, 1, 1),
    };
    let offered = OfferedProfile {
        history: 1,
        depth,
        reliability,
        durability,
        deadline: INFINITE_DURATION,
        lifespan: INFINITE_DURATION,
        liveliness: 1,
        liveliness_lease_duration: INFINITE_DURATION,
        avoid_ros_namespace_conventions: false,
    };
    serde_yaml_ng::to_string(&[offered])
        .map(|text| text.trim_end().to_owned())
        .map_err(|e| e.to_string())
}

/// The profile of a topic without stored profiles: `/tf_static` is latched in every ROS 2 system.
pub(crate) fn default_profile(topic: &str) -> QosProfile {
    if topic == "/tf_static" { QosProfile::Latched } else { QosProfile::Standard }
}

/// The profile to play a topic with, from the YAML text of what was offered; `None` if the text
/// holds no profile.
pub(crate) fn from_yaml(text: &str) -> Option<QosProfile> {
    let profiles: Vec<serde_yaml_ng::Mapping> = serde_yaml_ng::from_str(text).ok()?;
    let first = profiles.first()?;
    Some(if has_policy(first, "durability", 1, "transient_local") {
        QosProfile::Latched
    } else if has_policy(first, "reliability", 2, "best_effort") {
        QosProfile::Sensor
    } else {
        QosProfile::Standard
    })
}

/// Whether the profile has the policy, as rmw's number (up to version 8) or as a word (from 9 on).
fn has_policy(profile: &serde_yaml_ng::Mapping, key: &str, number: u64, word: &str) -> bool {
    let value = profile.get(key);
    value.and_then(|v| v.as_u64()) == Some(number) || value.and_then(|v| v.as_str()) == Some(word)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_offered_is_read_back() {
        for profile in [QosProfile::Standard, QosProfile::Sensor, QosProfile::Latched] {
            assert_eq!(from_yaml(&to_yaml(profile).unwrap()), Some(profile));
        }
        let text = to_yaml(QosProfile::LatchedSub).unwrap();
        assert_eq!(from_yaml(&text), Some(QosProfile::Latched));
        assert!(text.starts_with("- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n"));
    }

    #[test]
    fn words_and_numbers_are_read_and_the_first_profile_counts() {
        for (text, profile) in [
            ("- {durability: transient_local}", QosProfile::Latched),
            ("- {durability: volatile, reliability: best_effort}", QosProfile::Sensor),
            ("- {durability: 2, reliability: 2}", QosProfile::Sensor),
            ("- {durability: 2, reliability: 1}\n- {durability: 1}", QosProfile::Standard),
            ("- {}", QosProfile::Standard),
        ] {
            assert_eq!(from_yaml(text), Some(profile), "{text}");
        }
        for text in ["", "[]", "durability: 1", "- 7", "- [", "no YAML: ["] {
            assert_eq!(from_yaml(text), None, "{text}");
        }
    }
}
