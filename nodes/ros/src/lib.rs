//! The ROS 2 side of puffer's nodes, over DDS (rustdds) and without an installed ROS: nodes with
//! arguments, parameters, logs and diagnostics, topics, services, actions, transforms, time, bags,
//! and the transport of large data. A node of puffer takes a message, calls one function of
//! `puffer_core` and publishes the result; everything about ROS in between is here.
//!
//! [`Node`] is the way in: [`Publisher`], [`Subscription`], [`Client`], [`ActionClient`] and
//! [`TfBuffer`] come from it. [`bag`] and [`conversions`] need no node.
//!
//! ```no_run
//! # use puffer_ros::{Node, NoParams, RosArgs, Stop};
//! pub async fn run(args: RosArgs, stop: Stop) -> anyhow::Result<()> {
//!     let node = Node::<NoParams>::start("listener", args, stop).await?;
//!     node.stop().stopped().await;
//!     Ok(())
//! }
//!
//! fn main() -> std::process::ExitCode {
//!     puffer_ros::main(run)
//! }
//! ```

mod action;
mod args;
pub mod bag;
mod clock;
pub mod conversions;
mod dds;
mod diagnostics;
pub mod domain;
mod entry;
pub mod large_data;
mod logging;
mod names;
mod node;
mod params;
mod qos;
pub mod scans;
mod service;
mod shared;
mod stamp;
mod stop;
mod tf;
mod topic;

pub use action::{ActionClient, Goal, GoalHandle, GoalProgress, Outcome};
pub use args::{RosArgs, ServiceMapping};
pub use diagnostics::{Diagnostics, Health};
pub use entry::{main, main_with};
pub use node::Node;
pub use params::NoParams;
pub use puffer_msgs::{Action, Interface, Service};
pub use qos::QosProfile;
pub use service::{CallError, Client};
pub use shared::{Shared, SharedGuard};
pub use stamp::Stamp;
pub use stop::Stop;
pub use tf::{TfBroadcaster, TfBuffer, TfError, Transform};
pub use topic::{Publisher, Subscription};
