//! The names that topics, services and types of ROS 2 have in DDS
//! (<https://design.ros2.org/articles/topic_and_service_names.html>).

/// DDS name of the topic with the absolute ROS name `name`.
pub(crate) fn ros_topic(name: &str) -> String {
    format!("rt{name}")
}

/// DDS name of the topic that carries the requests of the service with the absolute ROS name
/// `service`.
pub(crate) fn request_topic(service: &str) -> String {
    format!("rq{service}Request")
}

/// DDS name of the topic that carries the replies of the service with the absolute ROS name
/// `service`.
pub(crate) fn reply_topic(service: &str) -> String {
    format!("rr{service}Reply")
}

/// DDS name of the type `package/kind/name`, with `suffix` after its name.
pub(crate) fn type_name(package: &str, kind: &str, name: &str, suffix: &str) -> String {
    format!("{package}::{kind}::dds_::{name}{suffix}_")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_other_ros_2_implementations() {
        assert_eq!(ros_topic("/cell/points"), "rt/cell/points");
        assert_eq!(request_topic("/planner/plan_view"), "rq/planner/plan_viewRequest");
        assert_eq!(reply_topic("/planner/plan_view"), "rr/planner/plan_viewReply");
        let cloud = type_name("sensor_msgs", "msg", "PointCloud2", "");
        assert_eq!(cloud, "sensor_msgs::msg::dds_::PointCloud2_");
        let request = type_name("std_srvs", "srv", "SetBool", "_Request");
        assert_eq!(request, "std_srvs::srv::dds_::SetBool_Request_");
    }
}
