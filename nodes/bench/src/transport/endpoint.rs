//! One process of the transport benchmark: a publisher or a reader. It reports events as JSON lines
//! on standard output and ends when standard input is closed.

use super::memory::memory_use;
use super::payload::{check_payload, make_payload};
use anyhow::{Context as _, Result};
use clap::{Args, ValueEnum};
use puffer_ros::large_data::{
    Delivery, LargeDataPublisher, LargeDataSubscription, Retention, receive_buffer,
};
use ros2_client::{Context, Node, NodeName, NodeOptions};
use serde_json::{Value, json};
use std::io::Write;
use std::time::{Duration, Instant, SystemTime};

/// Longest time for the readers to appear.
const DISCOVERY_TIMEOUT: Duration = Duration::from_secs(30);
/// Longest time for the last samples to arrive.
const FLUSH_TIMEOUT: Duration = Duration::from_secs(60);
/// Depth of the publisher's queue: with one sample the next one waits in `publish`.
const QUEUE_DEPTH: usize = 1;

/// A publisher or a reader.
#[derive(Args)]
pub(crate) struct Endpoint {
    role: Role,
    #[arg(long)]
    domain: u16,
    #[arg(long)]
    topic: String,
    #[arg(long)]
    size: usize,
    #[arg(long, default_value_t = 0)]
    count: u64,
    #[arg(long, default_value_t = 0)]
    readers: usize,
    #[arg(long)]
    receive_buffer: usize,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Role {
    Queue,
    Latched,
    EveryReader,
    NewestReader,
}

impl Endpoint {
    pub(crate) fn run(&self) -> Result<()> {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()
            .context("no runtime for the benchmark's process")?;
        let outcome = runtime.block_on(async {
            let (context, mut node) = self.node()?;
            let outcome = match self.role {
                Role::Queue | Role::Latched => self.publish(&mut node).await,
                Role::EveryReader | Role::NewestReader => self.read(&mut node).await,
            };
            drop((node, context));
            outcome
        });
        // The thread that reads standard input would keep an ordinary shutdown waiting.
        runtime.shutdown_background();
        outcome
    }

    fn node(&self) -> Result<(Context, Node)> {
        let participant = rustdds::DomainParticipantBuilder::new(self.domain)
            .socket_receive_buffer_size(self.receive_buffer)
            .build()
            .with_context(|| format!("no DDS participant in domain {}", self.domain))?;
        let context = Context::from_domain_participant(participant)
            .map_err(|e| anyhow::anyhow!("no ROS context: {e}"))?;
        let name = NodeName::new("/", &format!("bench_{}", std::process::id()))
            .map_err(|e| anyhow::anyhow!("node name: {e}"))?;
        let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
        let node = context.new_node(name, options).map_err(|e| anyhow::anyhow!("no node: {e}"))?;
        Ok((context, node))
    }

    async fn publish(&self, node: &mut Node) -> Result<()> {
        let latched = self.role == Role::Latched;
        let mode =
            if latched { Retention::Latched } else { Retention::Queue { depth: QUEUE_DEPTH } };
        let publisher = LargeDataPublisher::new(node, &self.topic, mode)?;
        publisher.wait_for_readers(self.readers, DISCOVERY_TIMEOUT).await?;
        let before = memory_use().resident;
        report(
            &json!({ "event": "ready", "receive_buffer": receive_buffer(self.receive_buffer)? }),
        )?;
        if !latched {
            wait_for_line().await?;
        }
        let started = system_seconds();
        let mut longest = Duration::ZERO;
        for index in 0..self.count {
            let sample = make_payload(index, self.size);
            let since = Instant::now();
            publisher.publish(sample).await?;
            longest = longest.max(since.elapsed());
        }
        let behind = match publisher.flush(FLUSH_TIMEOUT).await {
            Ok(()) => Value::Null,
            Err(error) => error.to_string().into(),
        };
        let stats = publisher.stats();
        report(&json!({
            "event": "published", "started": started, "behind": behind, "before": before, "peak": memory_use().peak,
            "longest_publish": longest.as_secs_f64(), "missed": stats.missed, "dropped": stats.dropped,
            "tiles": stats.tiles, "repeated": stats.repeated,
        }))?;
        wait_for_line().await
    }

    async fn read(&self, node: &mut Node) -> Result<()> {
        let every = self.role == Role::EveryReader;
        let delivery = if every { Delivery::Every } else { Delivery::Newest };
        let subscription = LargeDataSubscription::<()>::new(node, &self.topic, delivery)?;
        report(
            &json!({ "event": "ready", "receive_buffer": receive_buffer(self.receive_buffer)? }),
        )?;
        let receive = async {
            loop {
                let sample = subscription.next_bytes().await?;
                let arrived = system_seconds();
                let index = check_payload(&sample, self.size);
                let rejected = subscription.stats().corrupt;
                report(&json!({
                    "event": "sample", "index": index, "at": arrived, "peak": memory_use().peak, "rejected": rejected
                }))?;
            }
        };
        tokio::select! {
            outcome = receive => outcome,
            outcome = wait_for_line() => outcome,
        }
    }
}

/// Waits for a line on standard input, or its end.
async fn wait_for_line() -> Result<()> {
    let read = tokio::task::spawn_blocking(|| std::io::stdin().read_line(&mut String::new()));
    read.await?.map(|_| ()).context("standard input")
}

/// Writes an event to standard output.
fn report(event: &Value) -> Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{event}").and_then(|()| out.flush()).context("standard output")
}

/// Seconds of the system's clock, which all processes of a machine share.
fn system_seconds() -> f64 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0.0, |t| t.as_secs_f64())
}
