//! Children that tell events as JSON lines.

use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, Sender};
use std::time::{Duration, Instant};

/// An event, and the number of the child that tells it; None = it has ended.
pub(super) type Event = (usize, Option<Value>);

/// A child process; killed when dropped.
pub(super) struct Process {
    child: Child,
}

impl Process {
    /// Starts this program again with `args`, behind the words of `prefix`.
    pub(super) fn start(
        number: usize,
        prefix: &[String],
        args: &[String],
        events: Sender<Event>,
    ) -> Result<Process> {
        let program = std::env::current_exe().context("where is this program?")?;
        let mut words = prefix.iter().map(String::as_str);
        let mut command = match words.next() {
            Some(first) => {
                let mut command = Command::new(first);
                command.args(words).arg(&program);
                command
            }
            None => Command::new(&program),
        };
        let mut child = command
            .args(args)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot start {}", program.display()))?;
        let out = child.stdout.take().context("no standard output")?;
        std::thread::spawn(move || {
            for line in BufReader::new(out).lines().map_while(Result::ok) {
                let event = serde_json::from_str(&line).ok();
                // Whoever listened may be gone.
                let _ = events.send((number, event));
            }
            let _ = events.send((number, None));
        });
        Ok(Process { child })
    }

    pub(super) fn say(&mut self, line: &str) -> Result<()> {
        let input = self.child.stdin.as_mut().context("standard input is closed")?;
        writeln!(input, "{line}").and_then(|()| input.flush()).context("the process has ended")
    }

    /// Sends a signal (STOP, CONT).
    pub(super) fn signal(&self, name: &str) -> Result<()> {
        let command = format!("kill -{name} {}", self.child.id());
        let status = Command::new("sh").args(["-c", &command]).status().context("no sh")?;
        if !status.success() {
            bail!("{command} failed");
        }
        Ok(())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        drop(self.child.stdin.take());
        let since = Instant::now();
        while since.elapsed() < Duration::from_secs(2) {
            if !matches!(self.child.try_wait(), Ok(None)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The next event before `deadline`.
pub(super) fn next_event(
    events: &Receiver<Event>,
    deadline: Instant,
    what: &str,
) -> Result<(usize, Value)> {
    let left = deadline.saturating_duration_since(Instant::now());
    match events.recv_timeout(left) {
        Ok((number, Some(event))) => Ok((number, event)),
        Ok((number, None)) => bail!("process {number} ended while waiting for {what}"),
        Err(_) => bail!("no {what} within the time"),
    }
}
