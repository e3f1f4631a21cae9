//! Programs that run beside the test.

use super::PUFFER;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU16, Ordering};
use std::time::{Duration, Instant};
use tokio::sync::{Mutex, MutexGuard};

/// For everything that must come: long enough for a loaded machine.
pub const SOON: Duration = Duration::from_secs(60);

/// Whole runs take turns: each needs the machine.
static RUN_TURN: Mutex<()> = Mutex::const_new(());

/// Waits for the turn of a whole run; the turn ends when the guard is dropped.
pub fn wait_for_run_turn() -> MutexGuard<'static, ()> {
    RUN_TURN.blocking_lock()
}

/// As [`wait_for_run_turn`], within a runtime.
pub async fn run_turn() -> MutexGuard<'static, ()> {
    RUN_TURN.lock().await
}

/// A domain that nobody uses, another one for each call.
pub fn free_domain() -> u16 {
    puffer_ros::domain::find_free().unwrap()
}

/// Waits until `holds` gives something.
pub fn eventually<T>(what: &str, mut holds: impl FnMut() -> Option<T>) -> T {
    let since = Instant::now();
    loop {
        if let Some(found) = holds() {
            return found;
        }
        assert!(since.elapsed() < SOON, "never: {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// `puffer` with arguments, its lines in a file. Killed when dropped.
pub struct Running {
    child: Child,
    lines: PathBuf,
}

impl Running {
    /// Starts it in `folder` on a domain.
    pub fn start(folder: &Path, domain: u16, arguments: &[&str]) -> Running {
        static NEXT: AtomicU16 = AtomicU16::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let lines = folder.join(format!("lines-{number}.txt"));
        let file = File::create(&lines).unwrap();
        let child = Command::new(PUFFER)
            .args(arguments)
            .current_dir(folder)
            .env("ROS_DOMAIN_ID", domain.to_string())
            .stdin(Stdio::null())
            .stdout(file.try_clone().unwrap())
            .stderr(file)
            .spawn()
            .unwrap();
        Running { child, lines }
    }

    /// What it has said.
    pub fn said(&self) -> String {
        std::fs::read_to_string(&self.lines).unwrap()
    }

    /// Waits until it says `text`.
    pub fn wait_for(&self, text: &str) {
        eventually(&format!("{text:?}"), || self.said().contains(text).then_some(()));
    }

    pub fn signal(&self, signal: Signal) {
        send(self.child.id(), signal);
    }

    /// Waits for its end; status and what it said. It must not have panicked.
    pub fn end(&mut self) -> (ExitStatus, String) {
        let status = eventually("the end of the program", || self.child.try_wait().unwrap());
        let said = self.said();
        assert!(!said.contains("panicked"), "{said}");
        (status, said)
    }

    /// Name and process of each node that it has started, once all are told.
    pub fn nodes(&self, count: usize) -> Vec<(String, u32)> {
        eventually("the roll of the nodes", || {
            let said = self.said();
            let words: Vec<&str> = said
                .split(|c: char| c.is_whitespace() || c == ',')
                .filter(|w| !w.is_empty())
                .collect();
            let found: Vec<_> = words.windows(2).filter_map(node_and_process).collect();
            (found.len() == count).then_some(found)
        })
    }
}

/// The node and its process that two words name, if they do.
fn node_and_process(words: &[&str]) -> Option<(String, u32)> {
    let named = words[0].contains('_') || words[0] == "modeller";
    let process = words[1].parse().ok().filter(|_| named)?;
    Some((words[0].to_owned(), process))
}

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub fn send(process: u32, signal: Signal) {
    kill(Pid::from_raw(i32::try_from(process).unwrap()), signal).unwrap();
}

/// Whether the process is there, and no zombie.
pub fn is_alive(process: u32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    stat.rsplit(')').next().is_some_and(|rest| !rest.is_empty() && !rest.trim().starts_with('Z'))
}

/// Waits until none of the processes is there.
pub fn assert_gone(nodes: &[(String, u32)]) {
    for (name, process) in nodes {
        eventually(&format!("the end of {name}"), || (!is_alive(*process)).then_some(()));
    }
}
