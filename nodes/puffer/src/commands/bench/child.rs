//! One process of the transport benchmark: a publisher or a reader. It tells its events as JSON lines on standard
//! output, and ends when standard input does.

use super::memory::resident;
use super::payload::{check, payload};
use anyhow::{Context as _, Result};
use clap::{Args, ValueEnum};
use puffer_shell::bulk::{BulkPublisher, BulkSubscription, Delivery, Mode, receive_buffer};
use ros2_client::{Context, Node, NodeName, NodeOptions};
use serde_json::{Value, json};
use std::io::Write;
use std::time::{Duration, Instant, SystemTime};

/// How long readers may take to appear.
const READERS_WITHIN: Duration = Duration::from_secs(30);
/// How long the last samples may take.
const FLUSH_WITHIN: Duration = Duration::from_secs(60);
/// Samples that the publisher holds: one; the next waits in `publish`.
const DEPTH: usize = 1;

/// What a child does.
#[derive(Args)]
pub struct Child {
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

impl Child {
    pub(super) fn run(&self) -> Result<()> {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()
            .context("no runtime for the benchmark's process")?;
        let done = runtime.block_on(async {
            let (context, mut node) = self.node()?;
            let outcome = match self.role {
                Role::Queue | Role::Latched => self.publish(&mut node).await,
                Role::EveryReader | Role::NewestReader => self.read(&mut node).await,
            };
            drop((node, context));
            outcome
        });
        // Standard input is read in a thread that would keep the runtime waiting.
        runtime.shutdown_background();
        done
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
        let mode = if latched { Mode::Latched } else { Mode::Queue { depth: DEPTH } };
        let publisher = BulkPublisher::new(node, &self.topic, mode)?;
        publisher.wait_for_readers(self.readers, READERS_WITHIN).await?;
        let before = resident().0;
        tell(&json!({ "event": "ready", "receive_buffer": receive_buffer(self.receive_buffer)? }))?;
        if !latched {
            line().await?;
        }
        let started = now();
        let mut longest = Duration::ZERO;
        for index in 0..self.count {
            let sample = payload(index, self.size);
            let since = Instant::now();
            publisher.publish(sample).await?;
            longest = longest.max(since.elapsed());
        }
        let behind = match publisher.flush(FLUSH_WITHIN).await {
            Ok(()) => Value::Null,
            Err(error) => error.to_string().into(),
        };
        let stats = publisher.stats();
        tell(&json!({
            "event": "published", "started": started, "behind": behind, "before": before, "peak": resident().1,
            "longest_publish": longest.as_secs_f64(), "missed": stats.missed, "dropped": stats.dropped,
            "tiles": stats.tiles, "repeated": stats.repeated,
        }))?;
        line().await
    }

    async fn read(&self, node: &mut Node) -> Result<()> {
        let every = self.role == Role::EveryReader;
        let delivery = if every { Delivery::Every } else { Delivery::Newest };
        let subscription = BulkSubscription::<()>::new(node, &self.topic, delivery)?;
        tell(&json!({ "event": "ready", "receive_buffer": receive_buffer(self.receive_buffer)? }))?;
        let receive = async {
            loop {
                let sample = subscription.next_bytes().await?;
                let arrived = now();
                let index = check(&sample, self.size);
                let rejected = subscription.stats().corrupt;
                tell(&json!({
                    "event": "sample", "index": index, "at": arrived, "peak": resident().1, "rejected": rejected
                }))?;
            }
        };
        tokio::select! {
            outcome = receive => outcome,
            outcome = line() => outcome,
        }
    }
}

/// Waits for a line on standard input, or its end.
async fn line() -> Result<()> {
    let read = tokio::task::spawn_blocking(|| std::io::stdin().read_line(&mut String::new()));
    read.await?.map(|_| ()).context("standard input")
}

fn tell(event: &Value) -> Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{event}").and_then(|()| out.flush()).context("standard output")
}

/// Seconds of the system's clock: the same for all processes of a machine.
fn now() -> f64 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0.0, |t| t.as_secs_f64())
}
