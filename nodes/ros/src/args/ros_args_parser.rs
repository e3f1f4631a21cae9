//! Reads arguments and environment variables.

use super::ros_args::RosArgs;
use super::{command_line, environment};
use anyhow::Result;

impl RosArgs {
    /// Reads arguments (without the program's name) and the environment variables `ROS_DOMAIN_ID`,
    /// `ROS_NAMESPACE` and `RMW_IMPLEMENTATION`.
    ///
    /// # Errors
    /// An unknown or incomplete ROS argument, a parameter file that cannot be read, a domain out of
    /// range.
    pub fn parse(args: impl IntoIterator<Item = String>) -> Result<Self> {
        Self::parse_with(args, |name| std::env::var(name).ok())
    }

    /// As [`RosArgs::parse`], with the values of environment variables from a function.
    ///
    /// # Errors
    /// As [`RosArgs::parse`].
    pub fn parse_with(
        args: impl IntoIterator<Item = String>,
        environment: impl Fn(&str) -> Option<String>,
    ) -> Result<Self> {
        let mut parsed = Self::default();
        environment::read(&mut parsed, environment)?;
        command_line::read(&mut parsed, args)?;
        Ok(parsed)
    }
}
