//! Nodes as processes: this program again, as `puffer node NAME`.

use super::Crew;
use anyhow::{Context, Result};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::fs::{File, OpenOptions};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};
use std::time::Duration;
use tokio::process::{Child, Command};

/// How long a node may take to end when it is asked to.
const GRACE: Duration = Duration::from_secs(20);
/// How often nodes are looked at.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// Lines of a lost node that are told.
const LAST_LINES: usize = 3;

/// Whether a node ended because it was asked to, be it before it could listen to signals.
fn was_asked(status: ExitStatus) -> bool {
    matches!(status.code(), Some(0 | 130)) || status.signal() == Some(Signal::SIGTERM as i32)
}

fn open(log: &Path) -> Result<File> {
    OpenOptions::new()
        .create(true)
        .append(true)
        .open(log)
        .with_context(|| format!("cannot write {}", log.display()))
}

/// The processes.
pub(crate) struct Processes {
    children: Vec<(&'static str, Child)>,
    log: Option<PathBuf>,
}

impl Processes {
    pub(super) fn start(crew: &Crew) -> Result<Processes> {
        let program = std::env::current_exe().context("cannot find this program's own file")?;
        let log = crew.log.as_deref().map(open).transpose()?;
        let mut processes = Processes { children: Vec::new(), log: crew.log.clone() };
        for node in &crew.nodes {
            let lines = || match &log {
                Some(file) => file.try_clone().map(Stdio::from),
                None => Ok(Stdio::inherit()),
            };
            let child = Command::new(&program)
                .args(["node", "--with-parent", node.name, "--ros-args", "--params-file"])
                .arg(&crew.params)
                .args(&crew.more)
                .env("ROS_DOMAIN_ID", crew.domain.to_string())
                // The terminal's Ctrl-C is for this process, which ends them in order. They end, too, when the other
                // end of their standard input is gone with this process.
                .process_group(0)
                .stdin(Stdio::piped())
                .stdout(lines()?)
                .stderr(lines()?)
                .kill_on_drop(true)
                .spawn()
                .with_context(|| format!("cannot start {}", node.name))?;
            processes.children.push((node.name, child));
        }
        Ok(processes)
    }

    pub(super) fn roll(&self) -> Vec<(String, u32)> {
        let entry = |(name, child): &(&'static str, Child)| {
            ((*name).to_owned(), child.id().unwrap_or_default())
        };
        self.children.iter().map(entry).collect()
    }

    pub(super) async fn loss(&mut self) -> String {
        loop {
            let mut children = self.children.iter_mut().enumerate();
            let ended = children.find_map(|(place, (name, child))| {
                child.try_wait().ok().flatten().map(|status| (place, *name, status))
            });
            if let Some((place, name, status)) = ended {
                self.children.remove(place);
                return format!("{name} has ended ({status}){}", self.last_words(name));
            }
            tokio::time::sleep(LOOK_EVERY).await;
        }
    }

    /// The last complaints in the log: the node's own, and those that name no node.
    fn last_words(&self, name: &str) -> String {
        let Some(log) = &self.log else { return "; its lines stand above".to_owned() };
        let text = std::fs::read_to_string(log).unwrap_or_default();
        let own = |line: &str| ["[ERROR]", "[WARN]"].iter().any(|word| line.starts_with(word));
        let complains = |line: &&str| {
            line.starts_with("error:")
                || line.contains("panicked at")
                || own(line) && line.contains(name)
        };
        let lines: Vec<&str> = text.lines().filter(complains).collect();
        match &lines[lines.len().saturating_sub(LAST_LINES)..] {
            [] => String::new(),
            last => format!("; it said: {}", last.join(" / ")),
        }
    }

    pub(super) async fn stop(mut self) -> Vec<String> {
        for (_, child) in &self.children {
            if let Some(id) = child.id().and_then(|id| i32::try_from(id).ok()) {
                // One that has ended already needs no signal.
                let _ = kill(Pid::from_raw(id), Signal::SIGTERM);
            }
        }
        let mut problems = Vec::new();
        for (name, child) in &mut self.children {
            match tokio::time::timeout(GRACE, child.wait()).await {
                Ok(Ok(status)) if was_asked(status) => {}
                Ok(Ok(status)) => problems.push(format!("{name} ended with {status}")),
                Ok(Err(error)) => problems.push(format!("{name}: {error}")),
                Err(_) => {
                    problems.push(format!("{name} did not end within {GRACE:?} and was killed"));
                    if let Err(error) = child.kill().await {
                        problems.push(format!("{name}: {error}"));
                    }
                }
            }
        }
        problems
    }
}
