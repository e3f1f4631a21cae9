//! The publisher of large data: a thread that runs [`TileSender`].

use super::large_data_error::LargeDataError;
use super::tile::{Tile, TileAck};
use super::tile_sender::{Retention, TileSender};
use super::tile_topics::{TileTopics, guid_text, spawn_thread};
use super::whole_message_writer::WholeMessageWriter;
use bytes::Bytes;
use futures::{FutureExt, StreamExt};
use ros2_client::{MessageTypeName, Node, Publisher, Subscription};
use rustdds::DomainParticipant;
use serde::Serialize;
use std::pin::pin;
use std::time::{Duration, Instant};
use tokio::sync::{mpsc, oneshot, watch};

/// Longest time that [`LargeDataPublisher::publish`] waits for room.
const MAX_PUBLISH_WAIT: Duration = Duration::from_secs(10);

/// Publishes messages of any size in tiles; see [`large_data`](crate::large_data).
///
/// It is made by [`Node::large_data_publisher`](crate::Node::large_data_publisher) or
/// [`Node::large_data_publisher_for_any_reader`](crate::Node::large_data_publisher_for_any_reader).
/// Dropping it ends the transport, and what has not arrived by then is lost: see
/// [`LargeDataPublisher::flush`].
pub struct LargeDataPublisher {
    topic: String,
    commands: mpsc::UnboundedSender<Command>,
    stats: watch::Receiver<PublisherStats>,
    whole_messages: Option<WholeMessageWriter>,
}

/// Figures of a [`LargeDataPublisher`] since its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PublisherStats {
    /// Readers that have been heard of within 10 s.
    pub readers: usize,
    /// Samples published.
    pub published: u64,
    /// Sequence number of the newest sample that every reader has; that of the newest sample if
    /// there is no reader.
    pub delivered: u64,
    /// Samples given up before every reader had them: a reader did not answer, or took too long.
    pub missed: u64,
    /// Samples given up because nobody came to read them.
    pub dropped: u64,
    /// Tiles sent, repetitions included.
    pub tiles: u64,
    /// Tiles sent again.
    pub repeated: u64,
}

/// What the publisher asks of its thread.
enum Command {
    Publish(PendingPublish),
    Flush { since: Instant, deadline: Instant, flushed: FlushReply },
}

/// A sample that waits for room.
struct PendingPublish {
    bytes: Bytes,
    /// When other samples are given up for it.
    deadline: Instant,
    /// Gets the sample's sequence number.
    admitted: oneshot::Sender<u64>,
}

/// Where the outcome of a flush goes.
type FlushReply = oneshot::Sender<Result<(), LargeDataError>>;

impl LargeDataPublisher {
    /// Starts the transport for `topic`, an absolute ROS name with namespace and remappings
    /// resolved.
    ///
    /// # Errors
    /// If the name is not allowed, or DDS makes no endpoints.
    pub fn new(
        node: &mut Node,
        topic: &str,
        mode: Retention,
    ) -> Result<LargeDataPublisher, LargeDataError> {
        let topics = TileTopics::new(node, topic)?;
        let tiles: Publisher<Tile> = topics.tile_writer(node)?;
        let acks: Subscription<TileAck> = topics.ack_reader(node)?;
        let sender = TileSender::new(tiles.guid().to_bytes(), mode);
        let (commands, queue) = mpsc::unbounded_channel();
        let (newest_stats, stats) = watch::channel(PublisherStats::default());
        let thread = PublisherThread {
            topic: topic.to_owned(),
            sender,
            tiles,
            stats: newest_stats,
            waiting: Vec::new(),
            flushes: Vec::new(),
            warned: GivenUp::default(),
        };
        spawn_thread(topic, "tile_writer", move || thread.run(acks, queue))?;
        Ok(LargeDataPublisher { topic: topic.to_owned(), commands, stats, whole_messages: None })
    }

    /// Also publishes the messages, of type `kind`, as ordinary DDS samples on the topic itself,
    /// for readers that know nothing of tiles (RViz, rosbag2, scripts): only while there are any,
    /// and only messages that `net.core.rmem_max` carries. With `latched` the newest message stays
    /// for readers that come later.
    ///
    /// # Errors
    /// If DDS makes no endpoint.
    pub fn with_whole_messages(
        mut self,
        participant: &DomainParticipant,
        kind: &MessageTypeName,
        latched: bool,
    ) -> Result<LargeDataPublisher, LargeDataError> {
        let writer = WholeMessageWriter::new(participant, &self.topic, kind, latched)?;
        self.whole_messages = Some(writer);
        Ok(self)
    }

    /// Hands over a sample: a serialized message with its encapsulation header. Returns the
    /// sample's sequence number, from 1.
    ///
    /// A latched topic takes the sample at once. A queue that is full waits, at most 10 s, for
    /// readers that are slow but alive; then, or if readers do not answer, its oldest sample is
    /// given up, logged and counted.
    ///
    /// # Errors
    /// If the transport has ended.
    pub async fn publish(&self, bytes: Bytes) -> Result<u64, LargeDataError> {
        if let Some(writer) = &self.whole_messages {
            writer.publish(bytes.clone());
        }
        let deadline = Instant::now() + MAX_PUBLISH_WAIT;
        let (admitted, number) = oneshot::channel();
        self.send(Command::Publish(PendingPublish { bytes, deadline, admitted }))?;
        number.await.map_err(|_| self.closed_error())
    }

    /// Serializes and publishes `message`.
    ///
    /// # Errors
    /// As [`LargeDataPublisher::publish`]; also if the message cannot be serialized.
    pub async fn publish_message<M: Serialize>(&self, message: &M) -> Result<u64, LargeDataError> {
        let bytes = puffer_msgs::cdr::to_bytes(message)
            .map_err(|reason| LargeDataError::Message { topic: self.topic.clone(), reason })?;
        self.publish(bytes.into()).await
    }

    /// Waits until every reader has the newest sample.
    ///
    /// # Errors
    /// After `within` (wall time), naming the readers that lack the sample.
    pub async fn flush(&self, within: Duration) -> Result<(), LargeDataError> {
        let (flushed, answer) = oneshot::channel();
        let since = Instant::now();
        self.send(Command::Flush { since, deadline: since + within, flushed })?;
        answer.await.map_err(|_| self.closed_error())?
    }

    /// Waits until at least `wanted` readers are there.
    ///
    /// # Errors
    /// After `within` (wall time), saying how many came.
    pub async fn wait_for_readers(
        &self,
        wanted: usize,
        within: Duration,
    ) -> Result<(), LargeDataError> {
        let since = Instant::now();
        let mut stats = self.stats.clone();
        let enough = stats.wait_for(|stats| stats.readers >= wanted);
        match tokio::time::timeout(within, enough).await {
            Ok(Ok(_)) => Ok(()),
            // The transport's thread, which writes the figures, has ended.
            Ok(Err(_)) => Err(self.closed_error()),
            Err(_) => Err(LargeDataError::Readers {
                topic: self.topic.clone(),
                found: self.stats().readers,
                wanted,
                waited: since.elapsed(),
            }),
        }
    }

    /// Resolves when there is a reader; never if the transport has ended.
    pub(crate) async fn wait_for_first_reader(&self) {
        let mut stats = self.stats.clone();
        if stats.wait_for(|stats| stats.readers > 0).await.is_err() {
            std::future::pending::<()>().await;
        }
    }

    /// The figures up to now.
    pub fn stats(&self) -> PublisherStats {
        *self.stats.borrow()
    }

    fn send(&self, command: Command) -> Result<(), LargeDataError> {
        self.commands.send(command).map_err(|_| self.closed_error())
    }

    fn closed_error(&self) -> LargeDataError {
        LargeDataError::Closed { topic: self.topic.clone() }
    }
}

/// What the publisher's thread owns.
struct PublisherThread {
    topic: String,
    sender: TileSender,
    tiles: Publisher<Tile>,
    stats: watch::Sender<PublisherStats>,
    /// Samples that wait for room, the oldest first.
    waiting: Vec<PendingPublish>,
    flushes: Vec<Flush>,
    /// The losses that the log knows of.
    warned: GivenUp,
}

/// A flush that waits for readers.
struct Flush {
    /// Sequence number of the sample that every reader must have.
    target: u64,
    since: Instant,
    deadline: Instant,
    flushed: FlushReply,
}

/// Numbers of samples that were given up.
#[derive(Clone, Copy, Default, PartialEq)]
struct GivenUp {
    missed: u64,
    dropped: u64,
}

impl PublisherThread {
    async fn run(
        mut self,
        acks: Subscription<TileAck>,
        mut commands: mpsc::UnboundedReceiver<Command>,
    ) {
        let mut acks = pin!(acks.async_stream());
        loop {
            let next = self.step();
            tokio::select! {
                Some(ack) = acks.next() => self.on_ack(ack),
                command = commands.recv() => match command {
                    Some(command) => self.on_command(command),
                    None => return,
                },
                () = tokio::time::sleep_until(next.into()) => {}
            }
            while let Some(Some(ack)) = acks.next().now_or_never() {
                self.on_ack(ack);
            }
        }
    }

    fn on_ack(&mut self, ack: ros2_client::error::ReadResult<(TileAck, ros2_client::MessageInfo)>) {
        match ack {
            Ok((ack, _)) => self.sender.on_ack(ack, Instant::now()),
            Err(error) => {
                tracing::debug!("{}: an acknowledgement is unreadable: {error}", self.topic)
            }
        }
    }

    fn on_command(&mut self, command: Command) {
        match command {
            Command::Publish(publish) => self.waiting.push(publish),
            Command::Flush { since, deadline, flushed } => {
                let target = self.sender.newest();
                self.flushes.push(Flush { target, since, deadline, flushed });
            }
        }
    }

    /// Does what can be done now; returns when the next step is due.
    fn step(&mut self) -> Instant {
        let now = Instant::now();
        self.admit_samples(now);
        for tile in self.sender.poll(now) {
            // Best effort: a tile that does not go out is not acknowledged, and sent again.
            if let Err(error) = self.tiles.publish(tile) {
                tracing::debug!("{}: a tile was not sent: {error}", self.topic);
            }
        }
        self.answer_flushes(now);
        self.report();
        let deadlines = self.waiting.iter().map(|publish| publish.deadline);
        let deadlines = deadlines.chain(self.flushes.iter().map(|flush| flush.deadline));
        deadlines.fold(self.sender.next_poll(now), Instant::min)
    }

    /// Hands waiting samples to the sender as long as there is room.
    fn admit_samples(&mut self, now: Instant) {
        while let Some(first) = self.waiting.first() {
            if !self.sender.make_room(now >= first.deadline, now) {
                return;
            }
            let publish = self.waiting.remove(0);
            // Whoever published may have stopped waiting.
            let _ = publish.admitted.send(self.sender.push(publish.bytes, now));
        }
    }

    fn answer_flushes(&mut self, now: Instant) {
        let flushes = std::mem::take(&mut self.flushes);
        for flush in flushes {
            let missing = self.sender.readers_without(flush.target);
            if missing.is_empty() {
                // Whoever flushed may have stopped waiting.
                let _ = flush.flushed.send(Ok(()));
            } else if now >= flush.deadline {
                let _ = flush.flushed.send(Err(LargeDataError::Missing {
                    topic: self.topic.clone(),
                    waited: now.duration_since(flush.since),
                    readers: self.sender.readers(),
                    missing: missing.iter().map(guid_text).collect(),
                }));
            } else {
                self.flushes.push(flush);
            }
        }
    }

    /// Logs new losses and updates the figures.
    fn report(&mut self) {
        let counts = self.sender.counts;
        let given_up = GivenUp { missed: counts.missed, dropped: counts.dropped };
        if given_up != self.warned {
            let (missed, dropped) =
                (counts.missed - self.warned.missed, counts.dropped - self.warned.dropped);
            self.warned = given_up;
            let behind = self.sender.readers_without(self.sender.newest());
            let behind: Vec<String> = behind.iter().map(guid_text).collect();
            tracing::warn!(
                "{}: {missed} samples given up that readers lack, {dropped} that nobody came to read; behind: [{}]",
                self.topic,
                behind.join(", ")
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
        self.stats.send_if_modified(|newest| {
            let is_changed = *newest != stats;
            *newest = stats;
            is_changed
        });
    }
}
