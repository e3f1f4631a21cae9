//! What the DDS endpoints of clients and servers have in common.

use crate::dds::type_name;
use puffer_msgs::Service;

/// Depth of the queues of requests and replies, as in rmw_qos_profile_services_default.
pub(super) const SERVICE_QOS_DEPTH: i32 = 10;

/// DDS name of the type of a service's requests.
pub(super) fn request_type<S: Service>() -> String {
    type_name(S::PACKAGE, S::KIND, S::NAME, "_Request")
}

/// DDS name of the type of a service's replies.
pub(super) fn reply_type<S: Service>() -> String {
    type_name(S::PACKAGE, S::KIND, S::NAME, "_Response")
}
