//! The node of a command, on the domain that `ROS_DOMAIN_ID` names.

use anyhow::Result;
use puffer_core::Error;
use puffer_ros::{NoParams, Node, RosArgs, Stop};
use std::time::Duration;

/// How long the runtime may take to end.
const SHUTDOWN_DEADLINE: Duration = Duration::from_secs(1);

/// Runs `work` with a node of its own and the flag that Ctrl-C sets; the node stops when the work
/// has ended, or with the flag where `ends_with_flag` says so.
///
/// # Errors
/// Those of the work, or no network.
pub(super) fn with_node<T>(
    name: &str,
    arguments: &[&str],
    ends_with_flag: bool,
    work: impl AsyncFnOnce(Node<NoParams>, Stop) -> Result<T>,
) -> Result<T> {
    let args = RosArgs::parse(arguments.iter().map(|a| (*a).to_owned()))?;
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    let done = runtime.block_on(async {
        let interrupted = Stop::on_signals()?;
        let own = if ends_with_flag { interrupted.child() } else { Stop::new() };
        let node = Node::<NoParams>::start(name, args, own.clone()).await?;
        let done = work(node, interrupted).await;
        own.stop();
        done
    });
    runtime.shutdown_timeout(SHUTDOWN_DEADLINE);
    done
}

/// The error that ends a command which was interrupted.
pub(super) fn interruption_error() -> anyhow::Error {
    Error::Cancelled.into()
}
