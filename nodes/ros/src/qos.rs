//! Quality-of-service (QoS) profiles.

use rustdds::policy::{Deadline, Durability, History, Lifespan, Liveliness, Reliability};
use rustdds::{Duration, QosPolicies, QosPolicyBuilder};

/// A quality-of-service profile of a topic. A subscription receives only from publishers that offer
/// at least what it requests: reliable and latched are more than best effort and not latched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QosProfile {
    /// Reliable, not latched, the last 10 samples: ROS 2's default for topics.
    Standard,
    /// Best effort, not latched, the last 5 samples: ROS 2's profile for sensor data.
    Sensor,
    /// Reliable and latched (transient local): subscriptions that come later get the last sample.
    /// For publishers.
    Latched,
    /// The same for subscriptions.
    LatchedSub,
}

/// How long a reliable writer whose queue is full waits before it gives a sample up.
const MAX_BLOCKING_TIME: Duration = Duration::from_millis(100);

impl QosProfile {
    /// The policies of DDS.
    pub(crate) fn policies(self) -> QosPolicies {
        match self {
            QosProfile::Standard => build(true, Durability::Volatile, 10),
            QosProfile::Sensor => build(false, Durability::Volatile, 5),
            QosProfile::Latched | QosProfile::LatchedSub => {
                build(true, Durability::TransientLocal, 1)
            }
        }
    }
}

/// Requests and replies: reliable and volatile, as rmw_qos_profile_services_default.
pub(crate) fn service(depth: i32) -> QosPolicies {
    build(true, Durability::Volatile, depth)
}

/// `/rosout` and `/parameter_events`: reliable, the last 1,000 samples, as in rclcpp.
pub(crate) fn events(durability: Durability) -> QosPolicies {
    build(true, durability, 1000)
}

/// `/clock`: best effort, the last sample, as rclcpp's ClockQoS.
pub(crate) fn clock() -> QosPolicies {
    build(false, Durability::Volatile, 1)
}

/// `/tf`: reliable, the last 100 samples, as in tf2.
pub(crate) fn transforms() -> QosPolicies {
    build(true, Durability::Volatile, 100)
}

/// Policies without deadline, lifespan and lease, which keep the last `depth` samples.
pub(crate) fn build(reliable: bool, durability: Durability, depth: i32) -> QosPolicies {
    QosPolicyBuilder::new()
        .reliability(if reliable {
            Reliability::Reliable { max_blocking_time: MAX_BLOCKING_TIME }
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

/// What subscriptions to `/tf_static` request: reliable and latched, with room for a message of
/// each publisher.
pub(crate) fn static_transforms() -> QosPolicies {
    build(true, Durability::TransientLocal, 100)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reliability, durability and depth.
    fn summary(qos: &QosPolicies) -> (bool, Durability, i32) {
        let is_reliable = matches!(qos.reliability(), Some(Reliability::Reliable { .. }));
        let Some(History::KeepLast { depth }) = qos.history() else { panic!("{qos:?}") };
        (is_reliable, qos.durability().unwrap(), depth)
    }

    #[test]
    fn profiles_are_those_of_rmw() {
        let standard = summary(&QosProfile::Standard.policies());
        assert_eq!(standard, (true, Durability::Volatile, 10));
        let sensor = summary(&QosProfile::Sensor.policies());
        assert_eq!(sensor, (false, Durability::Volatile, 5));
        for profile in [QosProfile::Latched, QosProfile::LatchedSub] {
            assert_eq!(summary(&profile.policies()), (true, Durability::TransientLocal, 1));
        }
        assert_eq!(summary(&clock()), (false, Durability::Volatile, 1));
        assert_eq!(summary(&service(7)), (true, Durability::Volatile, 7));
    }

    #[test]
    fn a_sensor_subscription_takes_from_every_publisher_and_no_other_does() {
        let sensor = QosProfile::Sensor.policies();
        for offered in [QosProfile::Standard, QosProfile::Sensor, QosProfile::Latched] {
            assert!(offered.policies().compliance_failure_wrt(&sensor).is_none());
        }
        for requested in [QosProfile::Standard, QosProfile::LatchedSub] {
            assert!(sensor.compliance_failure_wrt(&requested.policies()).is_some());
        }
    }
}
