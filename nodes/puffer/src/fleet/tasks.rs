//! Nodes as tasks of this process, each with a DDS participant of its own.

use super::Crew;
use anyhow::{Context, Result};
use puffer_shell::{RosArgs, Stop};
use std::time::Duration;
use tokio::task::JoinHandle;

/// How long a node may take to end when it is asked to.
const GRACE: Duration = Duration::from_secs(20);

/// The tasks.
pub(crate) struct Tasks {
    running: Vec<(&'static str, JoinHandle<Result<()>>)>,
    stop: Stop,
}

impl Tasks {
    pub(super) fn start(crew: &Crew) -> Result<Tasks> {
        let file = crew.params.to_str().context("the parameter file's path is not UTF-8")?;
        let args = ["--ros-args", "--params-file", file].map(str::to_owned);
        let args = RosArgs::parse(args.into_iter().chain(crew.more.iter().cloned()))?
            .with_domain(crew.domain);
        let stop = Stop::new();
        let running = crew
            .nodes
            .iter()
            .map(|node| (node.name, tokio::spawn((node.run)(args.clone(), stop.clone()))))
            .collect();
        Ok(Tasks { running, stop })
    }

    pub(super) fn names(&self) -> Vec<String> {
        self.running.iter().map(|(name, _)| (*name).to_owned()).collect()
    }

    pub(super) async fn loss(&mut self) -> String {
        loop {
            let ended = self.running.iter().position(|(_, task)| task.is_finished());
            if let Some(place) = ended {
                let (name, task) = self.running.swap_remove(place);
                return match task.await {
                    Ok(Ok(())) => format!("{name} has ended"),
                    Ok(Err(error)) => format!("{name} has ended: {error:#}"),
                    Err(error) => format!("{name} has ended: {error}"),
                };
            }
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    }

    pub(super) async fn stop(self) -> Vec<String> {
        self.stop.stop();
        let mut problems = Vec::new();
        for (name, task) in self.running {
            let abort = task.abort_handle();
            match tokio::time::timeout(GRACE, task).await {
                Ok(Ok(Ok(()))) => {}
                Ok(Ok(Err(error))) => problems.push(format!("{name}: {error:#}")),
                Ok(Err(error)) => problems.push(format!("{name}: {error}")),
                Err(_) => {
                    abort.abort();
                    problems.push(format!("{name} did not end within {GRACE:?}"));
                }
            }
        }
        problems
    }
}
