//! `--ros-args`, as every ROS 2 node takes them, and what the environment says.

mod file;
mod parse;
mod setting;

use crate::names::Remap;
use anyhow::{Context, Result, bail};
use serde_json::Value;
pub(crate) use setting::{Scope, Setting};

/// How a node's log lines go out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct LogOptions {
    /// Least severe level shown: "debug", "info", "warn", "error", "fatal".
    pub level: String,
    /// Whether lines go to standard error.
    pub stdout: bool,
    /// Whether lines go to `/rosout`.
    pub rosout: bool,
}

/// How services travel over DDS; the other side must use the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServiceMapping {
    /// As rmw_fastrtps: the related sample identity travels in the inline QoS.
    Enhanced,
    /// As rmw_cyclonedds: 16 bytes in front of the payload.
    Cyclone,
}

/// What a node was started with.
#[derive(Clone, Debug)]
pub struct RosArgs {
    pub(crate) domain: u16,
    pub(crate) namespace: String,
    pub(crate) mapping: ServiceMapping,
    pub(crate) remaps: Vec<Remap>,
    pub(crate) settings: Vec<Setting>,
    pub(crate) logs: LogOptions,
    rest: Vec<String>,
}

impl Default for RosArgs {
    /// No arguments, domain 0, nothing from the environment.
    fn default() -> Self {
        Self {
            domain: 0,
            namespace: "/".to_owned(),
            mapping: ServiceMapping::Enhanced,
            remaps: Vec::new(),
            settings: Vec::new(),
            logs: LogOptions { level: "info".to_owned(), stdout: true, rosout: true },
            rest: Vec::new(),
        }
    }
}

impl RosArgs {
    /// Reads arguments (without the program's name) and the environment: `ROS_DOMAIN_ID`, `ROS_NAMESPACE`,
    /// `RMW_IMPLEMENTATION`.
    ///
    /// # Errors
    /// An unknown or incomplete ROS argument, a parameter file that cannot be read, a domain out of range.
    pub fn parse(args: impl IntoIterator<Item = String>) -> Result<Self> {
        Self::parse_with(args, |name| std::env::var(name).ok())
    }

    /// As [`RosArgs::parse`], with the environment from a function.
    ///
    /// # Errors
    /// As [`RosArgs::parse`].
    pub fn parse_with(
        args: impl IntoIterator<Item = String>,
        environment: impl Fn(&str) -> Option<String>,
    ) -> Result<Self> {
        let set = |name: &str| environment(name).filter(|value| !value.trim().is_empty());
        let mut parsed = Self::default();
        if let Some(text) = set("ROS_DOMAIN_ID") {
            parsed.domain =
                text.trim().parse().ok().filter(|domain| *domain <= MAX_DOMAIN).with_context(
                    || format!("ROS_DOMAIN_ID is `{text}`; allowed are 0 to {MAX_DOMAIN}"),
                )?;
        }
        if let Some(namespace) = set("ROS_NAMESPACE") {
            parsed.namespace = namespace;
        }
        parsed.mapping = match set("RMW_IMPLEMENTATION").as_deref() {
            Some("rmw_cyclonedds_cpp") => ServiceMapping::Cyclone,
            None | Some("rmw_fastrtps_cpp" | "rmw_fastrtps_dynamic_cpp" | "rmw_connextdds") => {
                ServiceMapping::Enhanced
            }
            Some(other) => bail!(
                "RMW_IMPLEMENTATION is `{other}`, whose wire this program does not speak; set it to \
                 rmw_fastrtps_cpp or rmw_cyclonedds_cpp, and the other nodes alike"
            ),
        };
        parse::read(&mut parsed, args)?;
        Ok(parsed)
    }

    /// What was not a ROS argument, in order.
    pub fn rest(&self) -> &[String] {
        &self.rest
    }

    /// The same for another DDS domain.
    #[must_use]
    pub fn with_domain(mut self, domain: u16) -> Self {
        self.domain = domain;
        self
    }

    /// The same with a parameter `group.field` set for every node that these arguments start.
    #[must_use]
    pub fn with_param(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.settings.push(Setting {
            scope: Scope::Any,
            name: name.to_owned(),
            value: value.into(),
            origin: "the program".to_owned(),
        });
        self
    }

    /// The same with a node name.
    #[must_use]
    pub fn with_name(self, name: &str) -> Self {
        self.with_remap("__node", name)
    }

    /// The same with a remapping rule in front of all others; `from` may be `__node` or `__ns`.
    #[must_use]
    pub fn with_remap(mut self, from: &str, to: &str) -> Self {
        self.remaps.insert(0, Remap { node: None, from: from.to_owned(), to: to.to_owned() });
        self
    }

    /// The same with another convention for services.
    #[must_use]
    pub fn with_mapping(mut self, mapping: ServiceMapping) -> Self {
        self.mapping = mapping;
        self
    }

    /// The DDS domain.
    pub fn domain(&self) -> u16 {
        self.domain
    }
}

/// Beyond it the discovery port leaves 16 bits (RTPS 2.5, 9.6.2: 7400 + 250 d).
const MAX_DOMAIN: u16 = 232;

#[cfg(test)]
mod tests;
