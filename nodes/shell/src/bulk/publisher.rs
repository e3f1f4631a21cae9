//! The writer's end: a thread that runs [`Sender`].

use super::error::BulkError;
use super::sender::{Mode, Sender};
use super::topic::{Endpoints, name_of, start};
use super::whole::Whole;
use super::wire::{Tile, TileAck};
use bytes::Bytes;
use futures::{FutureExt, StreamExt};
use ros2_client::{MessageTypeName, Node, Publisher, Subscription};
use rustdds::DomainParticipant;
use serde::Serialize;
use std::pin::pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{mpsc, oneshot};

/// How long [`BulkPublisher::publish`] waits for room at most.
const PUBLISH_WAIT: Duration = Duration::from_secs(10);
/// How often [`BulkPublisher::wait_for_readers`] looks.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Sends samples of any size. Dropping it ends the transport; what has not arrived is lost then (see
/// [`BulkPublisher::flush`]).
pub struct BulkPublisher {
    topic: String,
    commands: mpsc::UnboundedSender<Command>,
    stats: Arc<Mutex<PublisherStats>>,
    whole: Option<Whole>,
}

/// Figures of a [`BulkPublisher`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PublisherStats {
    /// Readers that have been heard within 10 s.
    pub readers: usize,
    /// Samples published.
    pub published: u64,
    /// Samples that the slowest reader has; all of them if there is no reader.
    pub delivered: u64,
    /// Samples given up before every reader had them: a reader did not answer, or took too long.
    pub missed: u64,
    /// Samples given up because nobody came to read them.
    pub dropped: u64,
    /// Tiles sent, and those of them that were sent again.
    pub tiles: u64,
    /// Tiles sent more than once.
    pub repeated: u64,
}

enum Command {
    Publish { bytes: Bytes, deadline: Instant, admitted: oneshot::Sender<u64> },
    Flush { since: Instant, deadline: Instant, flushed: oneshot::Sender<Result<(), BulkError>> },
}

impl BulkPublisher {
    /// Starts the transport for `topic`, an absolute ROS name with namespace and remappings resolved.
    ///
    /// # Errors
    /// If the name is no topic name, or DDS refuses.
    pub fn new(node: &mut Node, topic: &str, mode: Mode) -> Result<BulkPublisher, BulkError> {
        let ends = Endpoints::new(node, topic)?;
        let tiles: Publisher<Tile> = ends.tiles_writer(node)?;
        let acks: Subscription<TileAck> = ends.acks_reader(node)?;
        let sender = Sender::new(tiles.guid().to_bytes(), mode);
        let (commands, queue) = mpsc::unbounded_channel();
        let stats = Arc::new(Mutex::new(PublisherStats::default()));
        let run = Run {
            topic: topic.to_owned(),
            sender,
            tiles,
            stats: Arc::clone(&stats),
            waiting: Vec::new(),
            flushes: Vec::new(),
            told: (0, 0),
        };
        start(topic, "bulk_pub", move || run.run(acks, queue))?;
        Ok(BulkPublisher { topic: topic.to_owned(), commands, stats, whole: None })
    }

    /// Also publishes whole messages of type `kind` on the named topic, for readers that know nothing of tiles (RViz,
    /// rosbag2, scripts): only while there are any, and only what `net.core.rmem_max` carries. `latched`: the newest
    /// message stays for those that come later.
    ///
    /// # Errors
    /// If DDS refuses.
    pub fn with_whole_messages(
        mut self,
        participant: &DomainParticipant,
        kind: &MessageTypeName,
        latched: bool,
    ) -> Result<BulkPublisher, BulkError> {
        self.whole = Some(Whole::new(participant, &self.topic, kind, latched)?);
        Ok(self)
    }

    /// Hands over a sample: a serialized message with its encapsulation header. Returns its number, from 1.
    ///
    /// A latched topic takes it at once. A queue that is full waits, 10 s at most, for readers that are slow but
    /// alive; then, or if readers do not answer, its oldest sample is given up, logged and counted.
    ///
    /// # Errors
    /// If the transport has ended.
    pub async fn publish(&self, bytes: Bytes) -> Result<u64, BulkError> {
        if let Some(whole) = &self.whole {
            whole.publish(bytes.clone());
        }
        let deadline = Instant::now() + PUBLISH_WAIT;
        let (admitted, number) = oneshot::channel();
        self.send(Command::Publish { bytes, deadline, admitted })?;
        number.await.map_err(|_| self.closed())
    }

    /// Serializes and publishes `message`.
    ///
    /// # Errors
    /// As [`BulkPublisher::publish`]; also if the message has no CDR.
    pub async fn publish_message<M: Serialize>(&self, message: &M) -> Result<u64, BulkError> {
        let bytes = puffer_msgs::cdr::to_bytes(message)
            .map_err(|reason| BulkError::Message { topic: self.topic.clone(), reason })?;
        self.publish(bytes.into()).await
    }

    /// Waits until every reader has the newest sample, or `within` is over.
    ///
    /// # Errors
    /// Names the readers that lack it.
    pub async fn flush(&self, within: Duration) -> Result<(), BulkError> {
        let (flushed, answer) = oneshot::channel();
        let since = Instant::now();
        self.send(Command::Flush { since, deadline: since + within, flushed })?;
        answer.await.map_err(|_| self.closed())?
    }

    /// Waits until `wanted` readers are there, or `within` is over.
    ///
    /// # Errors
    /// Says how many came.
    pub async fn wait_for_readers(&self, wanted: usize, within: Duration) -> Result<(), BulkError> {
        let since = Instant::now();
        loop {
            let found = self.stats().readers;
            if found >= wanted {
                return Ok(());
            }
            if since.elapsed() > within {
                let topic = self.topic.clone();
                return Err(BulkError::Readers { topic, found, wanted, waited: since.elapsed() });
            }
            if self.commands.is_closed() {
                return Err(self.closed());
            }
            tokio::time::sleep(LOOK_EVERY).await;
        }
    }

    /// Figures up to now.
    pub fn stats(&self) -> PublisherStats {
        *self.stats.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn send(&self, command: Command) -> Result<(), BulkError> {
        self.commands.send(command).map_err(|_| self.closed())
    }

    fn closed(&self) -> BulkError {
        BulkError::Closed { topic: self.topic.clone() }
    }
}

/// What the thread holds.
struct Run {
    topic: String,
    sender: Sender,
    tiles: Publisher<Tile>,
    stats: Arc<Mutex<PublisherStats>>,
    waiting: Vec<(Bytes, Instant, oneshot::Sender<u64>)>,
    flushes: Vec<Flush>,
    /// Losses that the log knows of: missed, dropped.
    told: (u64, u64),
}

struct Flush {
    target: u64,
    since: Instant,
    deadline: Instant,
    flushed: oneshot::Sender<Result<(), BulkError>>,
}

impl Run {
    async fn run(
        mut self,
        acks: Subscription<TileAck>,
        mut commands: mpsc::UnboundedReceiver<Command>,
    ) {
        let mut acks = pin!(acks.async_stream());
        loop {
            let wake = self.step();
            tokio::select! {
                Some(ack) = acks.next() => self.hear(ack),
                command = commands.recv() => match command {
                    Some(command) => self.obey(command),
                    None => return,
                },
                () = tokio::time::sleep_until(wake.into()) => {}
            }
            while let Some(Some(ack)) = acks.next().now_or_never() {
                self.hear(ack);
            }
        }
    }

    fn hear(&mut self, ack: ros2_client::error::ReadResult<(TileAck, ros2_client::MessageInfo)>) {
        match ack {
            Ok((ack, _)) => self.sender.hear(ack, Instant::now()),
            Err(error) => {
                tracing::debug!("{}: an acknowledgement is unreadable: {error}", self.topic)
            }
        }
    }

    fn obey(&mut self, command: Command) {
        match command {
            Command::Publish { bytes, deadline, admitted } => {
                self.waiting.push((bytes, deadline, admitted));
            }
            Command::Flush { since, deadline, flushed } => {
                let target = self.sender.newest();
                self.flushes.push(Flush { target, since, deadline, flushed });
            }
        }
    }

    /// Does what can be done now; returns when to look again.
    fn step(&mut self) -> Instant {
        let now = Instant::now();
        self.admit(now);
        for tile in self.sender.poll(now) {
            // Best effort: what does not go out is missed, and sent again.
            if let Err(error) = self.tiles.publish(tile) {
                tracing::debug!("{}: a tile was not sent: {error}", self.topic);
            }
        }
        self.answer_flushes(now);
        self.tell();
        let deadlines = self.waiting.iter().map(|w| w.1);
        let deadlines = deadlines.chain(self.flushes.iter().map(|f| f.deadline));
        deadlines.fold(self.sender.wake(now), Instant::min)
    }

    fn admit(&mut self, now: Instant) {
        while let Some((_, deadline, _)) = self.waiting.first() {
            if !self.sender.make_room(now >= *deadline, now) {
                return;
            }
            let (bytes, _, admitted) = self.waiting.remove(0);
            // Whoever published may have stopped waiting.
            let _ = admitted.send(self.sender.push(bytes, now));
        }
    }

    fn answer_flushes(&mut self, now: Instant) {
        let flushes = std::mem::take(&mut self.flushes);
        for flush in flushes {
            let missing = self.sender.missing(flush.target);
            if missing.is_empty() {
                // Whoever flushed may have stopped waiting.
                let _ = flush.flushed.send(Ok(()));
            } else if now >= flush.deadline {
                let _ = flush.flushed.send(Err(BulkError::Missing {
                    topic: self.topic.clone(),
                    waited: now.duration_since(flush.since),
                    readers: self.sender.readers(),
                    missing: missing.iter().map(name_of).collect(),
                }));
            } else {
                self.flushes.push(flush);
            }
        }
    }

    fn tell(&mut self) {
        let counts = self.sender.counts;
        if (counts.missed, counts.dropped) != self.told {
            let (missed, dropped) = (counts.missed - self.told.0, counts.dropped - self.told.1);
            self.told = (counts.missed, counts.dropped);
            let silent: Vec<String> =
                self.sender.missing(self.sender.newest()).iter().map(name_of).collect::<Vec<_>>();
            tracing::warn!(
                "{}: {missed} samples given up that readers lack, {dropped} that nobody came to read; behind: [{}]",
                self.topic,
                silent.join(", ")
            );
        }
        let stats = PublisherStats {
            readers: self.sender.readers(),
            published: self.sender.newest(),
            delivered: self.sender.delivered(),
            missed: counts.missed,
            dropped: counts.dropped,
            tiles: counts.tiles,
            repeated: counts.repeated,
        };
        *self.stats.lock().unwrap_or_else(PoisonError::into_inner) = stats;
    }
}
