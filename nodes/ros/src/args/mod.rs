//! The arguments after `--ros-args`, as every ROS 2 node takes them, and the environment variables
//! of ROS 2.

mod command_line;
mod environment;
mod params_file;
mod ros_args;
mod ros_args_parser;
mod setting;
#[cfg(test)]
mod tests;

pub(crate) use ros_args::LogOptions;
pub use ros_args::{RosArgs, ServiceMapping};
pub(crate) use setting::{Scope, Setting};
