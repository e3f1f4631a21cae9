//! The ROS 2 interfaces of puffer, and the standard ones that it uses, as Rust types.
//!
//! The build script makes the types from the interface files. Those of this package are `msg::X`,
//! `srv::X` and `action::X`; those of other packages are `sensor_msgs::msg::X` and so on. Each type
//! knows its ROS name and definition ([`Interface`]); services and actions name the types that
//! belong to them ([`Service`], [`Action`]). [`cdr`] turns messages into bytes and back.
//!
//! ```
//! use puffer_msgs::sensor_msgs::msg::PointCloud2;
//! use puffer_msgs::{Interface, definitions};
//!
//! assert_eq!(PointCloud2::TYPE_NAME, "sensor_msgs/msg/PointCloud2");
//! let (_, text) = definitions().iter().find(|(name, _)| *name == PointCloud2::TYPE_NAME).unwrap();
//! assert!(text.contains("uint32 point_step") && text.contains("MSG: std_msgs/Header"));
//! ```

pub mod cdr;
#[doc(hidden)]
pub mod field_serde;
mod interface;
#[cfg(test)]
mod tests;
mod time;

pub use interface::{
    Action, FeedbackMessage, GetResultRequest, GetResultResponse, Interface, SendGoalRequest,
    SendGoalResponse, Service, TypeVisitor,
};

#[cfg(not(test))]
include!(concat!(env!("OUT_DIR"), "/interfaces.rs"));
#[cfg(test)]
include!(concat!(env!("OUT_DIR"), "/interfaces_and_kinds.rs"));

/// Name (`sensor_msgs/msg/PointCloud2`) and full definition (`ros2msg` text, with those of all
/// types inside) of each message, request, response, goal, result, feedback and feedback message,
/// sorted by name.
pub fn definitions() -> &'static [(&'static str, &'static str)] {
    &DEFINITIONS
}
