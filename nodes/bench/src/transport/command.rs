//! The command: starts a publisher and readers and evaluates the events that they report.

use super::child_process::{ChildProcess, Event, next_event};
use super::received_samples::ReceivedSamples;
use super::stream_report::StreamReport;
use anyhow::{Result, bail};
use clap::Args;
use puffer::exit_status::usage_error;
use puffer::table::ResultTable;
use puffer_ros::domain;
use serde_json::{Value, json};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// Samples that are published before a late joiner starts.
const LATCHED_SAMPLES: u64 = 3;
/// A late joiner that receives nothing more for this time has received the newest sample only.
const QUIET_TIME: Duration = Duration::from_secs(2);
/// Number of the publisher among the processes; the readers have the numbers from 1.
const PUBLISHER_NUMBER: usize = 0;
/// Samples start with their number and hold at least one more word.
const MIN_SAMPLE_BYTES: usize = 16;

/// Sends samples from one process to others and checks every byte.
#[derive(Args)]
pub(crate) struct TransportBenchmark {
    /// Bytes of a sample
    #[arg(long, default_value_t = 30_000_000, value_name = "BYTES")]
    size: usize,
    /// Samples to send
    #[arg(long, default_value_t = 20, value_name = "N")]
    count: u64,
    /// Reading processes
    #[arg(long, default_value_t = 1, value_name = "K")]
    readers: usize,
    /// One more reader, stopped (SIGSTOP) after its first sample
    #[arg(long)]
    stop_reader: bool,
    /// Also publish on a latched topic before a reader comes
    #[arg(long)]
    late_joiner: bool,
    /// Receive buffer to ask the system for, bytes; 212992 is what a stock machine allows
    #[arg(long, default_value_t = 212_992, value_name = "BYTES")]
    receive_buffer: usize,
    /// DDS domain [default: a free one]
    #[arg(long, value_name = "N")]
    domain: Option<u16>,
    /// Words before the readers' command, such as "ip netns exec NAME"
    #[arg(long, value_name = "WORDS", hide = true, default_value = "")]
    reader_prefix: String,
    /// Longest time for everything, seconds
    #[arg(long, default_value_t = 120, value_name = "S")]
    within: u64,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

impl TransportBenchmark {
    pub(crate) fn run(&self) -> Result<()> {
        if self.size < MIN_SAMPLE_BYTES || self.count == 0 || self.readers == 0 {
            return Err(usage_error("--size: at least 16; --count and --readers: at least 1"));
        }
        let domain = self.domain.map_or_else(domain::find_free, Ok)?;
        let mut report = ResultTable::default();
        self.measure_stream(domain, &mut report)?;
        if self.late_joiner {
            self.measure_late_joiner(domain, &mut report)?;
        }
        report.print(self.json);
        Ok(())
    }

    /// Sends every sample to every reader.
    fn measure_stream(&self, domain: u16, report: &mut ResultTable) -> Result<()> {
        let deadline = Instant::now() + Duration::from_secs(self.within);
        let (sender, events) = channel();
        let all = self.readers + usize::from(self.stop_reader);
        let mut readers = Vec::new();
        for number in 1..=all {
            readers.push(self.start_endpoint("every-reader", domain, number, all, &sender)?);
        }
        let mut publisher = self.start_endpoint("queue", domain, PUBLISHER_NUMBER, all, &sender)?;
        let buffers = wait_until_ready(&events, all + 1, deadline)?;
        publisher.send_line("go")?;
        let mut received: Vec<ReceivedSamples> =
            (0..=all).map(|_| ReceivedSamples::default()).collect();
        let mut published = Value::Null;
        while published.is_null()
            || received[1..=self.readers].iter().any(|r| (r.times.len() as u64) < self.count)
        {
            let Ok((number, event)) = next_event(&events, deadline, "sample") else { break };
            if event["event"] == "published" {
                published = event;
                continue;
            }
            received[number].add_event(&event);
            if number > self.readers && received[number].times.len() == 1 {
                readers[number - 1].signal("STOP")?;
            }
        }
        if let (true, Some(stopped)) = (self.stop_reader, readers.last()) {
            stopped.signal("CONT")?;
        }
        let stream = StreamReport {
            size: self.size,
            count: self.count,
            receive_buffer: self.receive_buffer,
            buffers: &buffers,
            live: &received[1..=self.readers],
            stopped: received.last().filter(|_| self.stop_reader),
            published: &published,
        };
        stream.add_to(report);
        Ok(())
    }

    /// Checks that a reader that starts late receives the newest sample only.
    fn measure_late_joiner(&self, domain: u16, report: &mut ResultTable) -> Result<()> {
        let deadline = Instant::now() + Duration::from_secs(self.within);
        let (sender, events) = channel();
        let _publisher = self.start_endpoint("latched", domain, PUBLISHER_NUMBER, 0, &sender)?;
        loop {
            if next_event(&events, deadline, "latched samples")?.1["event"] == "published" {
                break;
            }
        }
        let _reader = self.start_endpoint("newest-reader", domain, 1, 0, &sender)?;
        wait_until_ready(&events, 1, deadline)?;
        let since = Instant::now();
        let mut late = ReceivedSamples::default();
        let mut seconds = f64::NAN;
        while let Ok((_, event)) = {
            let until = if late.times.is_empty() { deadline } else { Instant::now() + QUIET_TIME };
            next_event(&events, until, "newest sample")
        } {
            late.add_event(&event);
            seconds = since.elapsed().as_secs_f64();
        }
        let right = late.indices == [LATCHED_SAMPLES - 1] && late.corrupt == 0;
        let text = format!(
            "{}: samples {:?} of {LATCHED_SAMPLES} published before, after {seconds:.2} s",
            if right { "newest only" } else { "WRONG" },
            late.indices
        );
        report.add(
            "late joiner",
            text,
            "late_joiner",
            json!({ "newest_only": right, "received": late.indices, "seconds": seconds }),
        );
        Ok(())
    }

    /// Starts one endpoint as a process of its own.
    fn start_endpoint(
        &self,
        role: &str,
        domain: u16,
        number: usize,
        readers: usize,
        events: &Sender<Event>,
    ) -> Result<ChildProcess> {
        let count = if role == "latched" { LATCHED_SAMPLES } else { self.count };
        let topic =
            if role == "latched" || role == "newest-reader" { "/bench_latched" } else { "/bench" };
        let numbers = [
            ("--domain", domain.to_string()),
            ("--topic", topic.to_owned()),
            ("--size", self.size.to_string()),
            ("--count", count.to_string()),
            ("--readers", readers.to_string()),
            ("--receive-buffer", self.receive_buffer.to_string()),
        ];
        let mut args = vec!["transport-child".to_owned(), role.to_owned()];
        args.extend(numbers.into_iter().flat_map(|(name, value)| [name.to_owned(), value]));
        let prefix: Vec<String> = if number == PUBLISHER_NUMBER {
            Vec::new()
        } else {
            self.reader_prefix.split_whitespace().map(str::to_owned).collect()
        };
        ChildProcess::start(number, &prefix, &args, events.clone())
    }
}

/// Waits until all processes are ready; returns the receive buffer sizes that were read back, each
/// value once.
fn wait_until_ready(events: &Receiver<Event>, all: usize, deadline: Instant) -> Result<Vec<u64>> {
    let mut buffers = Vec::new();
    for _ in 0..all {
        let (number, event) = next_event(events, deadline, "start of all processes")?;
        match event["receive_buffer"].as_u64() {
            Some(bytes) if event["event"] == "ready" => buffers.push(bytes),
            _ => bail!("process {number} said {event} at its start"),
        }
    }
    buffers.sort_unstable();
    buffers.dedup();
    Ok(buffers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_processes_must_be_ready_and_buffers_are_listed_once() {
        let deadline = Instant::now() + Duration::from_secs(5);
        let (sender, events) = channel();
        for (number, bytes) in [(0, 8), (1, 4), (2, 8)] {
            sender
                .send((number, Some(json!({"event": "ready", "receive_buffer": bytes}))))
                .unwrap();
        }
        assert_eq!(wait_until_ready(&events, 3, deadline).unwrap(), [4, 8]);
        sender.send((1, None)).unwrap();
        let error = wait_until_ready(&events, 1, deadline).unwrap_err().to_string();
        assert!(error.contains("process 1 ended"), "{error}");
    }
}
