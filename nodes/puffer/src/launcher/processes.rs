//! Nodes as processes: this program again, as `puffer node NAME`.

use super::config::LaunchConfig;
use anyhow::{Context, Result};
use futures::FutureExt;
use futures::future::select_all;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::fs::{File, OpenOptions};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};
use std::time::Duration;
use tokio::process::{Child, ChildStdin, Command};

/// How long a node may take to end when it is asked to.
const STOP_DEADLINE: Duration = Duration::from_secs(20);
/// Lines of its log that are reported when a node has ended by itself, at most.
const MAX_REPORTED_LINES: usize = 3;

/// Whether a node ended because it was asked to, with or without having handled the signal.
fn was_requested(status: ExitStatus) -> bool {
    matches!(status.code(), Some(0 | 130)) || status.signal() == Some(Signal::SIGTERM as i32)
}

fn open_log(log: &Path) -> Result<File> {
    OpenOptions::new()
        .create(true)
        .append(true)
        .open(log)
        .with_context(|| format!("cannot write {}", log.display()))
}

/// Where a node writes to: the log file, or without one the terminal.
fn output_of_node(log: Option<&File>) -> std::io::Result<Stdio> {
    match log {
        Some(file) => file.try_clone().map(Stdio::from),
        None => Ok(Stdio::inherit()),
    }
}

/// Whether a line of the log is a complaint of the node `name`, or one that names no node.
fn is_complaint(line: &str, name: &str) -> bool {
    let is_logged = line.starts_with("[ERROR]") || line.starts_with("[WARN]");
    line.starts_with("error:") || line.contains("panicked at") || is_logged && line.contains(name)
}

/// The processes.
pub(crate) struct NodeProcesses {
    processes: Vec<NodeProcess>,
    log: Option<PathBuf>,
}

struct NodeProcess {
    name: &'static str,
    child: Child,
    /// Held apart from the child, because waiting for a child closes its input, and a node ends
    /// when its input is closed.
    input: Option<ChildStdin>,
}

impl NodeProcess {
    fn new(name: &'static str, mut child: Child) -> NodeProcess {
        let input = child.stdin.take();
        NodeProcess { name, child, input }
    }
}

impl NodeProcesses {
    pub(super) fn start(config: &LaunchConfig) -> Result<NodeProcesses> {
        let program = std::env::current_exe().context("cannot find this program's own file")?;
        let log = config.log.as_deref().map(open_log).transpose()?;
        let mut processes = Vec::new();
        for node in &config.nodes {
            let child = Command::new(&program)
                .args(["node", "--with-parent", node.name, "--ros-args", "--params-file"])
                .arg(&config.params)
                .args(&config.more_args)
                .env("ROS_DOMAIN_ID", config.domain.to_string())
                // The terminal's Ctrl-C is for this process, which ends the nodes in order. They
                // end as well when this process has gone and closed their standard input.
                .process_group(0)
                .stdin(Stdio::piped())
                .stdout(output_of_node(log.as_ref())?)
                .stderr(output_of_node(log.as_ref())?)
                .kill_on_drop(true)
                .spawn()
                .with_context(|| format!("cannot start {}", node.name))?;
            processes.push(NodeProcess::new(node.name, child));
        }
        Ok(NodeProcesses { processes, log: config.log.clone() })
    }

    pub(super) fn process_ids(&self) -> Vec<(String, u32)> {
        let processes = self.processes.iter();
        processes.map(|node| (node.name.to_owned(), node.child.id().unwrap_or_default())).collect()
    }

    pub(super) async fn wait_for_exit(&mut self) -> String {
        if self.processes.is_empty() {
            return std::future::pending().await;
        }
        let exits = self.processes.iter_mut().map(|node| node.child.wait().boxed());
        let (status, index, _) = select_all(exits).await;
        let name = self.processes.remove(index).name;
        match status {
            Ok(status) => format!("{name} has ended ({status}){}", self.last_complaints(name)),
            Err(error) => format!("{name}: {error}"),
        }
    }

    /// The last complaints of the node in the log, as a part of a sentence.
    fn last_complaints(&self, name: &str) -> String {
        let Some(log) = &self.log else { return "; its lines stand above".to_owned() };
        let text = std::fs::read_to_string(log).unwrap_or_default();
        let lines: Vec<&str> = text.lines().filter(|line| is_complaint(line, name)).collect();
        match &lines[lines.len().saturating_sub(MAX_REPORTED_LINES)..] {
            [] => String::new(),
            last => format!("; it said: {}", last.join(" / ")),
        }
    }

    pub(super) async fn stop(mut self) -> Vec<String> {
        for node in &self.processes {
            if let Some(id) = node.child.id().and_then(|id| i32::try_from(id).ok()) {
                // One that has ended already needs no signal.
                let _ = kill(Pid::from_raw(id), Signal::SIGTERM);
            }
        }
        let mut problems = Vec::new();
        for NodeProcess { name, child, input } in &mut self.processes {
            drop(input.take());
            match tokio::time::timeout(STOP_DEADLINE, child.wait()).await {
                Ok(Ok(status)) if was_requested(status) => {}
                Ok(Ok(status)) => problems.push(format!("{name} ended with {status}")),
                Ok(Err(error)) => problems.push(format!("{name}: {error}")),
                Err(_) => {
                    problems.push(format!(
                        "{name} did not end within {STOP_DEADLINE:?} and was killed"
                    ));
                    if let Err(error) = child.kill().await {
                        problems.push(format!("{name}: {error}"));
                    }
                }
            }
        }
        problems
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shells in place of nodes, each with a name and a script.
    fn start_shells(scripts: &[(&'static str, &str)], log: Option<PathBuf>) -> NodeProcesses {
        let processes = scripts.iter().map(|(name, script)| {
            let mut command = Command::new("sh");
            command.args(["-c", script]).stdin(Stdio::piped()).kill_on_drop(true);
            NodeProcess::new(name, command.spawn().unwrap())
        });
        NodeProcesses { processes: processes.collect(), log }
    }

    #[tokio::test]
    async fn the_first_that_ends_is_reported_with_its_complaints() {
        let folder = tempfile::tempdir().unwrap();
        let log = folder.path().join("log.txt");
        let text = "[ERROR] [early]: lost\n[WARN] [late]: slow\n[INFO] [early]: ready\n\
                    thread 'main' panicked at src/main.rs\n[ERROR] [early]: gone\n";
        std::fs::write(&log, text).unwrap();
        let mut nodes = start_shells(&[("late", "exec sleep 60"), ("early", "exit 3")], Some(log));
        let why = nodes.wait_for_exit().await;
        let said = "[ERROR] [early]: lost / thread 'main' panicked at src/main.rs / \
                    [ERROR] [early]: gone";
        assert_eq!(why, format!("early has ended (exit status: 3); it said: {said}"));
        assert_eq!(nodes.process_ids().len(), 1);
        assert_eq!(nodes.stop().await, Vec::<String>::new());
    }

    #[tokio::test]
    async fn waiting_leaves_the_input_of_the_nodes_open() {
        let mut nodes = start_shells(&[("reader", "read line; exit 5")], None);
        let wait = tokio::time::timeout(Duration::from_millis(300), nodes.wait_for_exit());
        assert!(wait.await.is_err());
        drop(nodes.processes[0].input.take());
        assert!(nodes.wait_for_exit().await.starts_with("reader has ended (exit status: 5)"));
    }

    #[tokio::test]
    async fn a_node_that_ends_with_an_error_when_it_is_stopped_is_reported() {
        let script = "trap 'exit 4' TERM; echo ready; while :; do sleep 0.05; done";
        let mut command = Command::new("sh");
        let mut child = command.args(["-c", script]).stdout(Stdio::piped()).spawn().unwrap();
        let mut line = [0; 6];
        let mut output = child.stdout.take().unwrap();
        tokio::io::AsyncReadExt::read_exact(&mut output, &mut line).await.unwrap();
        let processes = vec![NodeProcess::new("stubborn", child)];
        let nodes = NodeProcesses { processes, log: None };
        assert_eq!(nodes.stop().await, ["stubborn ended with exit status: 4"]);
    }
}
