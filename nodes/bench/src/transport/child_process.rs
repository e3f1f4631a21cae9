//! Child processes that report events as JSON lines on standard output.

use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, Sender};
use std::time::{Duration, Instant};

/// A child has this time to end after its standard input is closed.
const END_TIMEOUT: Duration = Duration::from_secs(2);
/// Period at which the end of a child is polled.
const POLL_PERIOD: Duration = Duration::from_millis(10);

/// The number of a child and the event that it reports; `None` after its end.
pub(super) type Event = (usize, Option<Value>);

/// A child process. Dropping it closes its standard input and, if it does not end, kills it.
pub(super) struct ChildProcess {
    child: Child,
}

impl ChildProcess {
    /// Starts this program again with `args`; the words of `prefix` stand before its name.
    pub(super) fn start(
        number: usize,
        prefix: &[String],
        args: &[String],
        events: Sender<Event>,
    ) -> Result<ChildProcess> {
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
                // The receiver may be gone.
                let _ = events.send((number, event));
            }
            let _ = events.send((number, None));
        });
        Ok(ChildProcess { child })
    }

    /// Sends a line to the child's standard input.
    pub(super) fn send_line(&mut self, line: &str) -> Result<()> {
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

impl Drop for ChildProcess {
    fn drop(&mut self) {
        drop(self.child.stdin.take());
        let since = Instant::now();
        // The standard library has no wait with a timeout.
        while since.elapsed() < END_TIMEOUT {
            if !matches!(self.child.try_wait(), Ok(None)) {
                return;
            }
            std::thread::sleep(POLL_PERIOD);
        }
        // The child may have ended by itself meanwhile.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Waits for the next event until `deadline`; `what` names it in messages.
pub(super) fn next_event(
    events: &Receiver<Event>,
    deadline: Instant,
    what: &str,
) -> Result<(usize, Value)> {
    let remaining = deadline.saturating_duration_since(Instant::now());
    match events.recv_timeout(remaining) {
        Ok((number, Some(event))) => Ok((number, event)),
        Ok((number, None)) => bail!("process {number} ended while waiting for {what}"),
        Err(_) => bail!("no {what} within the time"),
    }
}
