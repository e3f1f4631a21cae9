//! The reader's end: a thread that runs [`Receiver`].

use super::error::BulkError;
use super::inbox::{Delivery, Inbox};
use super::plain::start_plain;
use super::receiver::Receiver;
use super::topic::{Endpoints, start};
use super::wire::{Tile, TileAck};
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

/// Samples above this are refused, bytes: no cloud or mesh of the project comes near it.
const LARGEST_SAMPLE: u64 = 1 << 30;
/// Tiles taken before an answer is given.
const TILES_IN_A_ROW: usize = 2;

/// Receives samples of any size, complete and as they were sent.
pub struct BulkSubscription<M> {
    topic: String,
    inbox: Arc<Inbox>,
    stats: Arc<Mutex<SubscriptionStats>>,
    /// Each ends its thread when it is dropped.
    _alive: oneshot::Sender<()>,
    _plain: Option<oneshot::Sender<()>>,
    message: PhantomData<fn() -> M>,
}

/// Figures of a [`BulkSubscription`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SubscriptionStats {
    /// Samples received.
    pub samples: u64,
    /// Tiles and samples that did not fit their checksums, and came again.
    pub corrupt: u64,
    /// Samples that were too large.
    pub refused: u64,
}

impl<M> BulkSubscription<M> {
    /// Starts to receive `topic`, an absolute ROS name with namespace and remappings resolved.
    ///
    /// # Errors
    /// If the name is no topic name, or DDS refuses.
    pub fn new(
        node: &mut Node,
        topic: &str,
        delivery: Delivery,
    ) -> Result<BulkSubscription<M>, BulkError> {
        let ends = Endpoints::new(node, topic)?;
        let tiles: Subscription<Tile> = ends.tiles_reader(node)?;
        let acks: Publisher<TileAck> = ends.acks_writer(node)?;
        let inbox = Arc::new(Inbox::new(delivery));
        let stats = Arc::new(Mutex::new(SubscriptionStats::default()));
        let (alive, dropped) = oneshot::channel();
        let run = Run {
            topic: topic.to_owned(),
            receiver: Receiver::new(tiles.guid().to_bytes(), LARGEST_SAMPLE),
            acks,
            inbox: Arc::clone(&inbox),
            stats: Arc::clone(&stats),
        };
        start(topic, "bulk_sub", move || run.run(tiles, dropped))?;
        let topic = topic.to_owned();
        Ok(BulkSubscription {
            topic,
            inbox,
            stats,
            _alive: alive,
            _plain: None,
            message: PhantomData,
        })
    }

    /// Also takes whole messages of type `kind` from the named topic, of writers that know nothing of tiles (a driver,
    /// a bag that is played).
    ///
    /// # Errors
    /// If DDS refuses.
    pub fn with_plain_messages(
        mut self,
        participant: &DomainParticipant,
        kind: &MessageTypeName,
    ) -> Result<BulkSubscription<M>, BulkError> {
        let inbox = Arc::clone(&self.inbox);
        self._plain = Some(start_plain(participant, &self.topic, kind, inbox)?);
        Ok(self)
    }

    /// The next sample: a serialized message with its encapsulation header.
    ///
    /// # Errors
    /// If the transport has ended.
    pub async fn next_bytes(&self) -> Result<Bytes, BulkError> {
        loop {
            match self.inbox.take() {
                Ok(Some(sample)) => return Ok(sample),
                Ok(None) => self.inbox.filled.notified().await,
                Err(_) => return Err(BulkError::Closed { topic: self.topic.clone() }),
            }
        }
    }

    /// Figures up to now.
    pub fn stats(&self) -> SubscriptionStats {
        *self.stats.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<M: DeserializeOwned> BulkSubscription<M> {
    /// The next message.
    ///
    /// # Errors
    /// If the transport has ended, or the sample is no message of this type (the next call goes on after it).
    pub async fn next(&self) -> Result<M, BulkError> {
        let bytes = self.next_bytes().await?;
        puffer_msgs::cdr::from_bytes(&bytes)
            .map_err(|reason| BulkError::Message { topic: self.topic.clone(), reason })
    }
}

/// What the thread holds.
struct Run {
    topic: String,
    receiver: Receiver,
    acks: Publisher<TileAck>,
    inbox: Arc<Inbox>,
    stats: Arc<Mutex<SubscriptionStats>>,
}

impl Run {
    async fn run(mut self, tiles: Subscription<Tile>, mut dropped: oneshot::Receiver<()>) {
        let mut tiles = pin!(tiles.async_stream());
        let inbox = Arc::clone(&self.inbox);
        loop {
            let wake = self.answer();
            tokio::select! {
                Some(tile) = tiles.next() => self.take(tile),
                () = inbox.taken.notified() => self.receiver.free(),
                () = tokio::time::sleep_until(wake.into()) => {}
                _ = &mut dropped => return,
            }
            for _ in 1..TILES_IN_A_ROW {
                let Some(Some(tile)) = tiles.next().now_or_never() else { break };
                self.take(tile);
            }
        }
    }

    fn take(&mut self, tile: ros2_client::error::ReadResult<(Tile, ros2_client::MessageInfo)>) {
        let tile = match tile {
            Ok((tile, _)) => tile,
            Err(error) => {
                tracing::debug!("{}: a tile is unreadable: {error}", self.topic);
                return;
            }
        };
        let full = self.inbox.is_full();
        if let Some(sample) = self.receiver.take(&tile, full, Instant::now()) {
            self.inbox.put(sample);
        }
        for complaint in self.receiver.complaints.drain(..) {
            tracing::warn!("{}: {complaint}", self.topic);
        }
    }

    /// Says what is due to be said; returns when to look again.
    fn answer(&mut self) -> Instant {
        let now = Instant::now();
        for ack in self.receiver.poll(self.inbox.is_full(), now) {
            // Best effort: it is repeated.
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
        self.receiver.wake(now)
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        self.inbox.close();
    }
}
