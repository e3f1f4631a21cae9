//! `puffer bench transport`: the bulk transport between processes.

use super::memory::MB;
use super::process::{Event, Process, next_event};
use crate::failure::usage;
use crate::table::Report;
use anyhow::{Result, bail};
use clap::Args;
use puffer_shell::domain;
use serde_json::{Value, json};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// Samples that are published before a late joiner comes.
const LATCHED: u64 = 3;
/// How long nothing more may come to a late joiner, for the verdict that only the newest did.
const QUIET: Duration = Duration::from_secs(2);
/// Number of the publisher among the processes; readers follow.
const PUBLISHER: usize = 0;

/// Sends samples from one process to others and checks every byte.
#[derive(Args)]
pub struct Transport {
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

/// What one reader received.
#[derive(Default)]
struct Received {
    indices: Vec<u64>,
    corrupt: u64,
    rejected: u64,
    times: Vec<f64>,
}

impl Transport {
    pub(super) fn run(&self) -> Result<()> {
        if self.size < 16 || self.count == 0 || self.readers == 0 {
            return Err(usage("--size: at least 16; --count and --readers: at least 1"));
        }
        let domain = self.domain.map_or_else(domain::free, Ok)?;
        let mut report = Report::default();
        self.stream(domain, &mut report)?;
        if self.late_joiner {
            self.join_late(domain, &mut report)?;
        }
        report.print(self.json);
        Ok(())
    }

    /// Every sample to every reader.
    fn stream(&self, domain: u16, report: &mut Report) -> Result<()> {
        let deadline = Instant::now() + Duration::from_secs(self.within);
        let (sender, events) = channel();
        let all = self.readers + usize::from(self.stop_reader);
        let mut readers = Vec::new();
        for number in 1..=all {
            readers.push(self.child("every-reader", domain, number, all, &sender)?);
        }
        let mut publisher = self.child("queue", domain, PUBLISHER, all, &sender)?;
        let buffers = wait_until_ready(&events, all + 1, deadline)?;
        publisher.say("go")?;
        let mut received: Vec<Received> = (0..=all).map(|_| Received::default()).collect();
        let mut published = Value::Null;
        while published.is_null()
            || received[1..=self.readers].iter().any(|r| (r.times.len() as u64) < self.count)
        {
            let Ok((number, event)) = next_event(&events, deadline, "sample") else { break };
            if event["event"] == "published" {
                published = event;
                continue;
            }
            received[number].note(&event);
            if number > self.readers && received[number].times.len() == 1 {
                readers[number - 1].signal("STOP")?;
            }
        }
        if let (true, Some(stopped)) = (self.stop_reader, readers.last()) {
            stopped.signal("CONT")?;
        }
        self.tell_stream(&received[1..], &published, &buffers, report);
        Ok(())
    }

    fn tell_stream(
        &self,
        received: &[Received],
        published: &Value,
        buffers: &[u64],
        report: &mut Report,
    ) {
        let live = &received[..self.readers];
        let delivered = live.iter().map(|r| r.indices.len() as u64).min().unwrap_or(0);
        let corrupt: u64 = received.iter().map(|r| r.corrupt).sum();
        let started = published["started"].as_f64().unwrap_or(f64::NAN);
        let last = live.iter().filter_map(|r| r.times.last()).fold(f64::NAN, |a, b| b.max(a));
        let rate = delivered as f64 * self.size as f64 / MB / (last - started);
        let gap = live.iter().map(|r| r.longest_gap(started)).fold(0.0, f64::max);
        let peak = published["peak"].as_f64().unwrap_or(f64::NAN) / MB;
        let extra = peak - published["before"].as_f64().unwrap_or(f64::NAN) / MB;
        let number = |key: &str| published[key].as_u64().unwrap_or(0);
        report.add(
            "receive buffer asked for",
            format!("{} bytes", self.receive_buffer),
            "receive_buffer_asked",
            self.receive_buffer,
        );
        let read_back: Vec<String> = buffers.iter().map(u64::to_string).collect();
        report.add(
            "read back (twice what is granted)",
            format!("{} bytes", read_back.join(", ")),
            "receive_buffer",
            json!(buffers),
        );
        report.add("sample", format!("{} bytes", self.size), "size", self.size);
        report.add(
            "delivered to every live reader",
            format!("{delivered} of {}", self.count),
            "delivered",
            delivered,
        );
        report.add_value("count", self.count);
        report.add_value("readers", self.readers);
        report.add("corrupt", corrupt.to_string(), "corrupt", corrupt);
        report.add("speed for each reader", format!("{rate:.1} MB/s"), "mb_per_s", rate);
        report.add("longest time between samples", format!("{gap:.2} s"), "longest_gap_s", gap);
        report.add(
            "publisher's peak memory",
            format!("{extra:.1} MB more than before ({peak:.1} MB in all)"),
            "peak_memory_mb",
            extra,
        );
        report.add_value("peak_memory_absolute_mb", peak);
        report.add(
            "longest publish()",
            format!("{:.2} s", published["longest_publish"].as_f64().unwrap_or(f64::NAN)),
            "longest_publish_s",
            published["longest_publish"].clone(),
        );
        report.add(
            "tiles sent, sent again",
            format!("{}, {}", number("tiles"), number("repeated")),
            "tiles",
            number("tiles"),
        );
        report.add_value("repeated", number("repeated"));
        let rejected: u64 = received.iter().map(|r| r.rejected).sum();
        report.add("tiles rejected by checksum", rejected.to_string(), "rejected", rejected);
        if let (true, Some(stopped)) = (self.stop_reader, received.last()) {
            let text = format!(
                "had {} samples when it stopped; {} given up for it",
                stopped.indices.len(),
                number("missed")
            );
            report.add(
                "stopped reader",
                text,
                "stopped_reader",
                json!({ "had": stopped.indices.len(), "missed": number("missed") }),
            );
        }
    }

    /// Only the newest sample to a reader that comes late.
    fn join_late(&self, domain: u16, report: &mut Report) -> Result<()> {
        let deadline = Instant::now() + Duration::from_secs(self.within);
        let (sender, events) = channel();
        let _publisher = self.child("latched", domain, PUBLISHER, 0, &sender)?;
        loop {
            if next_event(&events, deadline, "latched samples")?.1["event"] == "published" {
                break;
            }
        }
        let _reader = self.child("newest-reader", domain, 1, 0, &sender)?;
        wait_until_ready(&events, 1, deadline)?;
        let since = Instant::now();
        let mut late = Received::default();
        let mut seconds = f64::NAN;
        while let Ok((_, event)) = {
            let until = if late.times.is_empty() { deadline } else { Instant::now() + QUIET };
            next_event(&events, until, "newest sample")
        } {
            late.note(&event);
            seconds = since.elapsed().as_secs_f64();
        }
        let right = late.indices == [LATCHED - 1] && late.corrupt == 0;
        let text = format!(
            "{}: samples {:?} of {LATCHED} published before, after {seconds:.2} s",
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

    fn child(
        &self,
        role: &str,
        domain: u16,
        number: usize,
        readers: usize,
        events: &Sender<Event>,
    ) -> Result<Process> {
        let count = if role == "latched" { LATCHED } else { self.count };
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
        let mut args = vec!["bench".to_owned(), "transport-child".to_owned(), role.to_owned()];
        args.extend(numbers.into_iter().flat_map(|(name, value)| [name.to_owned(), value]));
        let prefix: Vec<String> = if number == PUBLISHER {
            Vec::new()
        } else {
            self.reader_prefix.split_whitespace().map(str::to_owned).collect()
        };
        Process::start(number, &prefix, &args, events.clone())
    }
}

impl Received {
    fn note(&mut self, event: &Value) {
        if event["event"] != "sample" {
            return;
        }
        match event["index"].as_u64() {
            Some(index) if !self.indices.contains(&index) => self.indices.push(index),
            _ => self.corrupt += 1,
        }
        self.rejected = event["rejected"].as_u64().unwrap_or(0);
        self.times.push(event["at"].as_f64().unwrap_or(f64::NAN));
    }

    fn longest_gap(&self, started: f64) -> f64 {
        let before = std::iter::once(&started).chain(&self.times);
        before.zip(&self.times).map(|(a, b)| b - a).fold(0.0, f64::max)
    }
}

/// Waits for all processes; returns the receive buffers that were read back, each value once.
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
