//! All ROS glue of puffer's nodes, and nothing else: arguments, names, parameters, logs, topics, services,
//! actions, transforms, time, diagnostics, bulk transport. A node takes a message, calls one function of core and
//! publishes the result; everything about ROS in between is here.
//!
//! ```no_run
//! # use puffer_shell::{Node, NoParams, Profile, RosArgs, Stop};
//! pub async fn run(args: RosArgs, stop: Stop) -> anyhow::Result<()> {
//!     let node = Node::<NoParams>::start("listener", args, stop).await?;
//!     node.stop().stopped().await;
//!     Ok(())
//! }
//!
//! fn main() -> std::process::ExitCode {
//!     puffer_shell::main(run)
//! }
//! ```

mod action;
mod args;
pub mod bag;
pub mod bulk;
mod clock;
pub mod convert;
mod dds;
mod diagnostics;
pub mod domain;
mod entry;
mod logging;
mod names;
mod node;
mod params;
mod qos;
pub mod scans;
mod service;
mod stamp;
mod stop;
mod tf;
mod topic;

pub use action::{ActionClient, Goal, GoalHandle, Outcome};
pub use args::{RosArgs, ServiceMapping};
pub use diagnostics::{Diagnostics, Health};
pub use entry::{main, main_with};
pub use node::Node;
pub use params::NoParams;
pub use puffer_msgs::{Action, Interface, Service};
pub use qos::Profile;
pub use service::{CallError, Client};
pub use stamp::Stamp;
pub use stop::Stop;
pub use tf::{TfBroadcaster, TfBuffer, TfError, Transform};
pub use topic::{Publisher, Subscription};
