//! The four quality-of-service profiles; nothing else in the suite names a policy.

use rustdds::policy::{Deadline, Durability, History, Lifespan, Liveliness, Reliability};
use rustdds::{Duration, QosPolicies, QosPolicyBuilder};

/// A named quality-of-service profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Profile {
    /// Reliable, the last 10 samples: ROS 2's default for topics.
    Standard,
    /// Best effort, the last 5 samples: consumers of raw sensor data.
    Sensor,
    /// Reliable, and late joiners get the last sample: for publishers.
    Latched,
    /// What a subscriber of a latched topic asks for.
    LatchedSub,
}

/// How long a writer whose queue is full waits before the sample is given up.
const FULL_QUEUE_WAIT: Duration = Duration::from_millis(100);

impl Profile {
    pub(crate) fn policies(self) -> QosPolicies {
        match self {
            Profile::Standard => build(true, Durability::Volatile, 10),
            Profile::Sensor => build(false, Durability::Volatile, 5),
            Profile::Latched | Profile::LatchedSub => build(true, Durability::TransientLocal, 1),
        }
    }
}

/// Requests and replies: as rmw_qos_profile_services_default.
pub(crate) fn service(depth: i32) -> QosPolicies {
    build(true, Durability::Volatile, depth)
}

/// `/rosout` and `/parameter_events`: as rclcpp's, 1,000 samples deep.
pub(crate) fn events(durability: Durability) -> QosPolicies {
    build(true, durability, 1000)
}

/// `/clock`: best effort, the last sample, as rclcpp's ClockQoS.
pub(crate) fn clock() -> QosPolicies {
    build(false, Durability::Volatile, 1)
}

/// `/tf`: reliable, 100 samples deep.
pub(crate) fn transforms() -> QosPolicies {
    build(true, Durability::Volatile, 100)
}

pub(crate) fn build(reliable: bool, durability: Durability, depth: i32) -> QosPolicies {
    QosPolicyBuilder::new()
        .reliability(if reliable {
            Reliability::Reliable { max_blocking_time: FULL_QUEUE_WAIT }
        } else {
            Reliability::BestEffort
        })
        .durability(durability)
        .history(History::KeepLast { depth })
        .liveliness(Liveliness::Automatic { lease_duration: Duration::INFINITE })
        .deadline(Deadline(Duration::INFINITE))
        .lifespan(Lifespan { duration: Duration::INFINITE })
        .build()
}

/// What subscribers of `/tf_static` ask for: a latched message from each publisher.
pub(crate) fn static_transforms() -> QosPolicies {
    build(true, Durability::TransientLocal, 100)
}
