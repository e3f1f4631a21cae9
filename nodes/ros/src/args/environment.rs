//! The environment variables of ROS 2.

use super::{RosArgs, ServiceMapping};
use anyhow::{Context, Result, bail};

/// The largest DDS domain: beyond it the discovery port leaves 16 bits (RTPS 2.5, 9.6.2: 7400 +
/// 250 d).
const MAX_DOMAIN: u16 = 232;

/// Takes over domain, namespace and convention for services. `environment` returns the value of a
/// variable; an empty one counts as not set.
pub(super) fn read(
    parsed: &mut RosArgs,
    environment: impl Fn(&str) -> Option<String>,
) -> Result<()> {
    let [domain, namespace, rmw] = ["ROS_DOMAIN_ID", "ROS_NAMESPACE", "RMW_IMPLEMENTATION"]
        .map(|name| environment(name).filter(|value| !value.trim().is_empty()));
    if let Some(text) = domain {
        parsed.domain =
            text.trim().parse().ok().filter(|domain| *domain <= MAX_DOMAIN).with_context(|| {
                format!("ROS_DOMAIN_ID is `{text}`; allowed are 0 to {MAX_DOMAIN}")
            })?;
    }
    if let Some(namespace) = namespace {
        parsed.namespace = namespace;
    }
    parsed.mapping = match rmw.as_deref() {
        Some("rmw_cyclonedds_cpp") => ServiceMapping::Cyclone,
        None | Some("rmw_fastrtps_cpp" | "rmw_fastrtps_dynamic_cpp" | "rmw_connextdds") => {
            ServiceMapping::Enhanced
        }
        Some(other) => bail!(
            "RMW_IMPLEMENTATION is `{other}`, whose wire this program does not speak; set it to \
             rmw_fastrtps_cpp or rmw_cyclonedds_cpp, and the other nodes alike"
        ),
    };
    Ok(())
}
