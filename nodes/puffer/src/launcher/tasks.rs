//! Nodes as tasks of this process, each with a DDS participant of its own.

use super::config::LaunchConfig;
use anyhow::{Context, Result};
use futures::future::select_all;
use puffer_ros::{RosArgs, Stop};
use std::time::Duration;
use tokio::task::JoinHandle;

/// How long a node may take to end when it is asked to.
const STOP_DEADLINE: Duration = Duration::from_secs(20);

/// The tasks.
pub(crate) struct NodeTasks {
    /// Each with the name of its node.
    running: Vec<(&'static str, JoinHandle<Result<()>>)>,
    stop: Stop,
}

impl NodeTasks {
    pub(super) fn start(config: &LaunchConfig) -> Result<NodeTasks> {
        let file = config.params.to_str().context("the parameter file's path is not UTF-8")?;
        let args = ["--ros-args", "--params-file", file].map(str::to_owned);
        let args = RosArgs::parse(args.into_iter().chain(config.more_args.iter().cloned()))?
            .with_domain(config.domain);
        let stop = Stop::new();
        let running = config
            .nodes
            .iter()
            .map(|node| (node.name, tokio::spawn((node.run)(args.clone(), stop.clone()))))
            .collect();
        Ok(NodeTasks { running, stop })
    }

    pub(super) fn names(&self) -> Vec<String> {
        self.running.iter().map(|(name, _)| (*name).to_owned()).collect()
    }

    pub(super) async fn wait_for_exit(&mut self) -> String {
        if self.running.is_empty() {
            return std::future::pending().await;
        }
        let exits = self.running.iter_mut().map(|(_, task)| task);
        let (exit, index, _) = select_all(exits).await;
        let (name, _) = self.running.swap_remove(index);
        match exit {
            Ok(Ok(())) => format!("{name} has ended"),
            Ok(Err(error)) => format!("{name} has ended: {error:#}"),
            Err(error) => format!("{name} has ended: {error}"),
        }
    }

    pub(super) async fn stop(self) -> Vec<String> {
        self.stop.stop();
        let mut problems = Vec::new();
        for (name, task) in self.running {
            let abort = task.abort_handle();
            match tokio::time::timeout(STOP_DEADLINE, task).await {
                Ok(Ok(Ok(()))) => {}
                Ok(Ok(Err(error))) => problems.push(format!("{name}: {error:#}")),
                Ok(Err(error)) => problems.push(format!("{name}: {error}")),
                Err(_) => {
                    abort.abort();
                    problems.push(format!("{name} did not end within {STOP_DEADLINE:?}"));
                }
            }
        }
        problems
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn the_first_that_ends_is_reported_and_the_others_are_stopped() {
        let stop = Stop::new();
        let (first, second) = (stop.clone(), stop.clone());
        let running = vec![
            (
                "patient",
                tokio::spawn(async move {
                    first.stopped().await;
                    Ok(())
                }),
            ),
            ("broken", tokio::spawn(async { anyhow::bail!("no network") })),
            (
                "failing",
                tokio::spawn(async move {
                    second.stopped().await;
                    anyhow::bail!("no report")
                }),
            ),
        ];
        let mut tasks = NodeTasks { running, stop };
        assert_eq!(tasks.wait_for_exit().await, "broken has ended: no network");
        assert_eq!(tasks.names(), ["patient", "failing"]);
        assert_eq!(tasks.stop().await, ["failing: no report"]);
    }
}
