//! The subscription to large data: a thread that runs [`TileReceiver`].

use super::large_data_error::LargeDataError;
use super::sample_queue::{Delivery, SampleQueue};
use super::tile::{Tile, TileAck};
use super::tile_receiver::TileReceiver;
use super::tile_topics::{TileTopics, spawn_thread};
use super::whole_message_reader::start_whole_message_reader;
use bytes::Bytes;
use futures::{FutureExt, StreamExt};
use ros2_client::{MessageTypeName, Node, Publisher, Subscription};
use rustdds::DomainParticipant;
use serde::de::DeserializeOwned;
use std::marker::PhantomData;
use std::pin::pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;
use tokio::sync::oneshot;

/// Samples above this size are refused: no cloud or mesh of the project comes near it.
const MAX_SAMPLE_BYTES: u64 = 1 << 30;
/// Largest number of tiles that are taken before an acknowledgement is sent.
const MAX_TILES_PER_ACK: usize = 2;

/// Receives messages of type `M` of any size in tiles, complete and as they were sent; see
/// [`large_data`](crate::large_data).
///
/// It is made by [`large_data_subscribe`](crate::Node::large_data_subscribe) or
/// [`large_data_subscribe_from_any_writer`](crate::Node::large_data_subscribe_from_any_writer) of
/// [`Node`](crate::Node).
pub struct LargeDataSubscription<M> {
    topic: String,
    queue: Arc<SampleQueue>,
    stats: Arc<Mutex<SubscriptionStats>>,
    /// Dropping it ends the thread that receives tiles.
    _tile_thread: oneshot::Sender<()>,
    /// Dropping it ends the thread that receives whole messages.
    _whole_message_thread: Option<oneshot::Sender<()>>,
    message: PhantomData<fn() -> M>,
}

/// Figures of a [`LargeDataSubscription`] since its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SubscriptionStats {
    /// Samples received.
    pub samples: u64,
    /// Tiles and samples that did not fit their checksums; they are sent again.
    pub corrupt: u64,
    /// Samples that were refused because they were too large.
    pub refused: u64,
}

impl<M> LargeDataSubscription<M> {
    /// Starts to receive `topic`, an absolute ROS name with namespace and remappings resolved.
    ///
    /// # Errors
    /// If the name is not allowed, or DDS makes no endpoints.
    pub fn new(
        node: &mut Node,
        topic: &str,
        delivery: Delivery,
    ) -> Result<LargeDataSubscription<M>, LargeDataError> {
        let topics = TileTopics::new(node, topic)?;
        let tiles: Subscription<Tile> = topics.tile_reader(node)?;
        let acks: Publisher<TileAck> = topics.ack_writer(node)?;
        let queue = Arc::new(SampleQueue::new(delivery));
        let stats = Arc::new(Mutex::new(SubscriptionStats::default()));
        let (alive, dropped) = oneshot::channel();
        let thread = SubscriptionThread {
            topic: topic.to_owned(),
            receiver: TileReceiver::new(tiles.guid().to_bytes(), MAX_SAMPLE_BYTES),
            acks,
            queue: Arc::clone(&queue),
            stats: Arc::clone(&stats),
        };
        spawn_thread(topic, "tile_reader", move || thread.run(tiles, dropped))?;
        let topic = topic.to_owned();
        Ok(LargeDataSubscription {
            topic,
            queue,
            stats,
            _tile_thread: alive,
            _whole_message_thread: None,
            message: PhantomData,
        })
    }

    /// Also takes messages, of type `kind`, that come as ordinary DDS samples on the topic itself,
    /// from writers that know nothing of tiles (a sensor's driver, a bag that is played).
    ///
    /// # Errors
    /// If the thread cannot be started.
    pub fn with_whole_messages(
        mut self,
        participant: &DomainParticipant,
        kind: &MessageTypeName,
    ) -> Result<LargeDataSubscription<M>, LargeDataError> {
        let queue = Arc::clone(&self.queue);
        self._whole_message_thread =
            Some(start_whole_message_reader(participant, &self.topic, kind, queue)?);
        Ok(self)
    }

    /// The next sample: a serialized message with its encapsulation header.
    ///
    /// # Errors
    /// If the transport has ended.
    pub async fn next_bytes(&self) -> Result<Bytes, LargeDataError> {
        loop {
            match self.queue.take() {
                Ok(Some(sample)) => return Ok(sample),
                Ok(None) => self.queue.filled.notified().await,
                Err(_) => return Err(LargeDataError::Closed { topic: self.topic.clone() }),
            }
        }
    }

    /// The figures up to now.
    pub fn stats(&self) -> SubscriptionStats {
        *self.stats.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<M: DeserializeOwned> LargeDataSubscription<M> {
    /// The next message.
    ///
    /// # Errors
    /// If the transport has ended, or the sample is no message of this type; the next call goes on
    /// with the sample after it.
    pub async fn next(&self) -> Result<M, LargeDataError> {
        let bytes = self.next_bytes().await?;
        puffer_msgs::cdr::from_bytes(&bytes)
            .map_err(|reason| LargeDataError::Message { topic: self.topic.clone(), reason })
    }
}

/// What the subscription's thread owns.
struct SubscriptionThread {
    topic: String,
    receiver: TileReceiver,
    acks: Publisher<TileAck>,
    queue: Arc<SampleQueue>,
    stats: Arc<Mutex<SubscriptionStats>>,
}

impl SubscriptionThread {
    async fn run(mut self, tiles: Subscription<Tile>, mut dropped: oneshot::Receiver<()>) {
        let mut tiles = pin!(tiles.async_stream());
        let queue = Arc::clone(&self.queue);
        loop {
            let next = self.acknowledge();
            tokio::select! {
                Some(tile) = tiles.next() => self.on_tile(tile),
                () = queue.taken.notified() => self.receiver.on_sample_taken(),
                () = tokio::time::sleep_until(next.into()) => {}
                _ = &mut dropped => return,
            }
            for _ in 1..MAX_TILES_PER_ACK {
                let Some(Some(tile)) = tiles.next().now_or_never() else { break };
                self.on_tile(tile);
            }
        }
    }

    fn on_tile(&mut self, tile: ros2_client::error::ReadResult<(Tile, ros2_client::MessageInfo)>) {
        let tile = match tile {
            Ok((tile, _)) => tile,
            Err(error) => {
                tracing::debug!("{}: a tile is unreadable: {error}", self.topic);
                return;
            }
        };
        let is_full = self.queue.is_full();
        if let Some(sample) = self.receiver.on_tile(&tile, is_full, Instant::now()) {
            self.queue.push(sample);
        }
        for complaint in self.receiver.complaints.drain(..) {
            tracing::warn!("{}: {complaint}", self.topic);
        }
    }

    /// Sends the acknowledgements that are due; returns when the next ones are.
    fn acknowledge(&mut self) -> Instant {
        let now = Instant::now();
        for ack in self.receiver.poll(self.queue.is_full(), now) {
            // Best effort: an acknowledgement that does not go out is repeated.
            if let Err(error) = self.acks.publish(ack) {
                tracing::debug!("{}: an acknowledgement was not sent: {error}", self.topic);
            }
        }
        let counts = self.receiver.counts;
        *self.stats.lock().unwrap_or_else(PoisonError::into_inner) = SubscriptionStats {
            samples: counts.samples,
            corrupt: counts.corrupt,
            refused: counts.refused,
        };
        self.receiver.next_poll(now)
    }
}

impl Drop for SubscriptionThread {
    fn drop(&mut self) {
        self.queue.close();
    }
}
