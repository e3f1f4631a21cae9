//! What a node was started with.

use super::setting::{Scope, Setting};
use crate::names::Remap;
use serde_json::Value;

/// Where a node's log lines go.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct LogOptions {
    /// Least severe level that is logged: "debug", "info", "warn", "error", "fatal".
    pub level: String,
    /// Whether lines go to standard error.
    pub stdout: bool,
    /// Whether lines go to `/rosout`.
    pub rosout: bool,
}

/// How requests and replies of services are matched over DDS; client and server must use the same
/// convention.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServiceMapping {
    /// As rmw_fastrtps: the related sample identity travels in the inline QoS of the sample.
    Enhanced,
    /// As rmw_cyclonedds: 16 bytes in front of the payload name the call.
    Cyclone,
}

/// What a node was started with: DDS domain, namespace, remappings, parameters and log options.
///
/// ```
/// use puffer_ros::RosArgs;
///
/// let args = "run.mcap --ros-args -r points:=/camera/points -p scan.radius:=0.1 -- --fast";
/// let args = RosArgs::parse_with(args.split(' ').map(str::to_owned), |variable| {
///     (variable == "ROS_DOMAIN_ID").then(|| "42".to_owned())
/// })?;
/// assert_eq!(args.domain(), 42);
/// assert_eq!(args.rest(), ["run.mcap", "--fast"]);
///
/// let mistake = ["--ros-args", "-p", "scan.radius"].map(str::to_owned);
/// let error = RosArgs::parse_with(mistake, |_| None).unwrap_err();
/// assert!(error.to_string().contains("expected name:=value"));
/// # Ok::<(), anyhow::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct RosArgs {
    pub(crate) domain: u16,
    pub(crate) namespace: String,
    pub(crate) mapping: ServiceMapping,
    pub(crate) remaps: Vec<Remap>,
    pub(crate) settings: Vec<Setting>,
    pub(crate) logs: LogOptions,
    pub(super) rest: Vec<String>,
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
    /// The arguments that are not for ROS, in order.
    pub fn rest(&self) -> &[String] {
        &self.rest
    }

    /// The same arguments for another DDS domain.
    #[must_use]
    pub fn with_domain(mut self, domain: u16) -> Self {
        self.domain = domain;
        self
    }

    /// The same arguments with a parameter `group.field` set for every node that they start.
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

    /// The same arguments with another node name.
    #[must_use]
    pub fn with_name(self, name: &str) -> Self {
        self.with_remap("__node", name)
    }

    /// The same arguments with a remapping rule in front of all others; `from` may be `__node` or
    /// `__ns`.
    #[must_use]
    pub fn with_remap(mut self, from: &str, to: &str) -> Self {
        self.remaps.insert(0, Remap { node: None, from: from.to_owned(), to: to.to_owned() });
        self
    }

    /// The same arguments with another convention for services.
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
