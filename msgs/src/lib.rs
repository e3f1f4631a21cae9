//! ROS 2 interfaces of puffer, and the standard ones that it uses, as Rust types.
//!
//! The types are made from the interface files by the build script. Those of this package are `msg::X`, `srv::X` and
//! `action::X`; those of other packages `sensor_msgs::msg::X` and so on. Each knows its ROS name and definition
//! ([`Interface`]); services and actions name the types that belong to them ([`Service`], [`Action`]).

pub mod cdr;
mod interface;
#[cfg(test)]
mod tests;
mod time;
#[doc(hidden)]
pub mod wire;

pub use interface::{
    Action, FeedbackMessage, GetResultRequest, GetResultResponse, Interface, SendGoalRequest,
    SendGoalResponse, Service, TypeVisitor,
};

#[cfg(not(test))]
include!(concat!(env!("OUT_DIR"), "/interfaces.rs"));
#[cfg(test)]
include!(concat!(env!("OUT_DIR"), "/interfaces_and_kinds.rs"));

/// Name (`sensor_msgs/msg/PointCloud2`) and full definition (`ros2msg` text, with those of all types inside) of each
/// message, request, response, goal, result, feedback and feedback message, sorted by name.
pub fn definitions() -> &'static [(&'static str, &'static str)] {
    &DEFINITIONS
}
