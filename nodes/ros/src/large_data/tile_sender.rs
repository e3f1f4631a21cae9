//! The writer's half of the protocol: which tile to send when.

use super::congestion_window::CongestionWindow;
use super::pending_sample::{PendingSample, TileState};
use super::reader_state::ReaderState;
use super::tile::{ALL_WRITERS, EndpointId, Tile, TileAck};
use bytes::Bytes;
use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

/// How often readers that do not answer are probed with an announcement.
const PROBE_PERIOD: Duration = Duration::from_millis(100);
/// Bytes that may be held beyond a queue's depth for readers that do not answer, until they are
/// known to be stuck: up to there the other readers go on.
const MAX_SPARE_BYTES: usize = 48_000_000;
/// Value of a tile's `after` that no reader reaches, so that none starts to receive the sample: a
/// newer one is there.
const AFTER_NEVER: u64 = u64::MAX;
/// How long to wait before the next poll while some reader lacks something.
const ACTIVE_POLL_PERIOD: Duration = Duration::from_millis(10);
/// How long to wait before the next poll while every reader has everything.
const IDLE_POLL_PERIOD: Duration = Duration::from_millis(500);

/// Which samples a topic keeps for readers that do not have them yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Retention {
    /// Only the newest sample counts (a mesh, a filtered cloud). It stays for readers that come
    /// later, and replaces an older one that nobody is receiving. At most two samples are held.
    Latched,
    /// Each sample counts (scans). At most `depth` samples are held, those on their way included.
    Queue {
        /// Largest number of samples held, at least 1.
        depth: usize,
    },
}

/// Counts of a writer since its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SenderCounts {
    /// Tiles sent, repetitions included.
    pub(crate) tiles: u64,
    /// Tiles sent again.
    pub(crate) repeated: u64,
    /// Samples given up before every reader had them.
    pub(crate) missed: u64,
    /// Samples given up while there was no reader.
    pub(crate) dropped: u64,
}

/// The writer's state, without DDS, threads and a clock of its own.
pub(crate) struct TileSender {
    writer: EndpointId,
    retention: Retention,
    /// Samples that some reader may lack, in the order of their sequence numbers.
    pending: VecDeque<PendingSample>,
    readers: BTreeMap<EndpointId, ReaderState>,
    /// Sequence number of the newest sample.
    newest: u64,
    window: CongestionWindow,
    /// Number of the last transmission of a tile.
    order: u64,
    pub(crate) counts: SenderCounts,
}

impl TileSender {
    pub(crate) fn new(writer: EndpointId, retention: Retention) -> TileSender {
        TileSender {
            writer,
            retention,
            pending: VecDeque::new(),
            readers: BTreeMap::new(),
            newest: 0,
            window: CongestionWindow::new(),
            order: 0,
            counts: SenderCounts::default(),
        }
    }

    /// Sequence number of the newest sample, 0 if there was none.
    pub(crate) fn newest(&self) -> u64 {
        self.newest
    }

    /// Number of readers.
    pub(crate) fn readers(&self) -> usize {
        self.readers.len()
    }

    /// Sequence number of the newest sample that every reader has.
    pub(crate) fn delivered(&self) -> u64 {
        self.readers.values().map(|r| r.done).min().unwrap_or(self.newest)
    }

    /// The readers that lack sample `sequence`.
    pub(crate) fn readers_without(&self, sequence: u64) -> Vec<EndpointId> {
        self.readers.iter().filter(|(_, r)| r.done < sequence).map(|(id, _)| *id).collect()
    }

    /// Makes room for a sample, if need be at the cost of stuck readers, or with `force` of any
    /// reader. Returns whether there is room now.
    pub(crate) fn make_room(&mut self, force: bool, now: Instant) -> bool {
        let Retention::Queue { depth } = self.retention else { return true };
        while self.pending.len() >= depth.max(1) {
            let Some(oldest) = self.pending.front().map(|s| s.sequence) else { break };
            if self.readers.is_empty() {
                self.counts.dropped += 1;
            } else if force || !self.answering_reader_lacks(oldest, now) {
                self.counts.missed += u64::from(self.readers.values().any(|r| r.done < oldest));
            } else {
                return self.can_spare_silent_readers(depth.max(1), now);
            }
            self.pending.pop_front();
        }
        true
    }

    /// Whether a reader that is not stuck lacks sample `sequence`.
    fn answering_reader_lacks(&self, sequence: u64, now: Instant) -> bool {
        self.readers.values().any(|r| r.done < sequence && !r.is_stuck(now))
    }

    /// Whether the readers that answer leave room for a sample, and what is held for the others
    /// alone is within its bound.
    fn can_spare_silent_readers(&self, depth: usize, now: Instant) -> bool {
        let answering: Vec<&ReaderState> =
            self.readers.values().filter(|r| !r.is_lagging(now)).collect();
        let (wanted, spare): (Vec<&PendingSample>, Vec<&PendingSample>) =
            self.pending.iter().partition(|s| answering.iter().any(|r| r.done < s.sequence));
        let spare_bytes: usize = spare.iter().map(|s| s.bytes.len()).sum();
        !answering.is_empty() && wanted.len() < depth && spare_bytes <= MAX_SPARE_BYTES
    }

    /// Takes a sample, for which there must be room; returns its sequence number.
    pub(crate) fn push(&mut self, bytes: Bytes, now: Instant) -> u64 {
        self.newest += 1;
        if self.retention == Retention::Latched {
            let kept = self.pending.iter().map(|s| s.sequence).find(|sequence| {
                self.readers.values().any(|r| r.is_receiving(*sequence) && !r.is_lagging(now))
            });
            self.pending.retain(|s| Some(s.sequence) == kept);
        }
        self.pending.push_back(PendingSample::new(self.newest, bytes));
        self.newest
    }

    /// Takes an acknowledgement.
    pub(crate) fn on_ack(&mut self, ack: TileAck, now: Instant) {
        if ack.writer != self.writer && ack.writer != ALL_WRITERS {
            return;
        }
        let writer = ack.writer;
        let reader = self.readers.entry(ack.reader).or_insert_with(|| ReaderState::new(now));
        if writer == ALL_WRITERS {
            reader.on_announcement(now);
            return;
        }
        let before = if reader.sequence == ack.sequence { reader.have.len() } else { 0 };
        reader.on_ack(ack, now);
        let (sequence, arrived) = (reader.sequence, reader.have.len().saturating_sub(before));
        if arrived > 0 {
            self.window.on_arrival(arrived);
        }
        let sample = self.pending.iter_mut().find(|s| s.sequence == sequence);
        if sample.is_some_and(|sample| sample.detect_losses(|i| reader.have.contains(i)) > 0) {
            self.window.on_loss(now);
        }
        self.release();
    }

    /// The tiles to send now.
    pub(crate) fn poll(&mut self, now: Instant) -> Vec<Tile> {
        let before = self.readers.len();
        self.readers.retain(|_, r| !r.is_gone(now));
        if self.readers.len() < before {
            self.release();
        }
        let mut tiles = Vec::new();
        for k in 0..self.pending.len() {
            self.poll_sample(k, now, &mut tiles);
        }
        tiles
    }

    /// When to poll again if nothing is heard until then.
    pub(crate) fn next_poll(&self, now: Instant) -> Instant {
        let is_active = self.readers.values().any(|r| self.wanted_by(r).is_some());
        now + if is_active { ACTIVE_POLL_PERIOD } else { IDLE_POLL_PERIOD }
    }

    /// Appends what to send of the pending sample at position `k`.
    fn poll_sample(&mut self, k: usize, now: Instant, tiles: &mut Vec<Tile>) {
        let wanting: Vec<EndpointId> = self
            .readers
            .iter()
            .filter(|(_, r)| !r.busy && self.wanted_by(r) == Some(k))
            .map(|(id, _)| *id)
            .collect();
        if wanting.is_empty() {
            return;
        }
        let answering: Vec<EndpointId> =
            wanting.iter().filter(|id| !self.readers[*id].is_lagging(now)).copied().collect();
        let first = tiles.len();
        if answering.is_empty() || self.pending[k].tile_count() == 0 {
            self.probe(k, now, tiles);
        } else {
            self.send_missing_tiles(k, &answering, now, tiles);
        }
        if tiles.len() > first {
            for id in &wanting {
                if let Some(reader) = self.readers.get_mut(id) {
                    reader.expect_ack(now);
                }
            }
        }
    }

    /// Announces a sample, which every reader has to answer.
    fn probe(&mut self, k: usize, now: Instant, tiles: &mut Vec<Tile>) {
        let sample = &mut self.pending[k];
        if sample.last_probe.is_none_or(|at| now.duration_since(at) >= PROBE_PERIOD) {
            sample.last_probe = Some(now);
            let announcement = sample.tile_count();
            tiles.push(self.tile(k, announcement));
        }
    }

    /// Appends the tiles that the readers `answering` lack, as far as the window allows.
    fn send_missing_tiles(
        &mut self,
        k: usize,
        answering: &[EndpointId],
        now: Instant,
        tiles: &mut Vec<Tile>,
    ) {
        let sequence = self.pending[k].sequence;
        let mut in_flight = 0;
        let mut to_send = Vec::new();
        let mut is_overdue = false;
        for i in 0..self.pending[k].tile_count() {
            if answering.iter().all(|id| self.readers[id].has_tile(sequence, i)) {
                continue;
            }
            match self.pending[k].tile_state(i, now) {
                TileState::InFlight => in_flight += 1,
                state if to_send.len() < self.window.tiles() => {
                    is_overdue |= state == TileState::Overdue;
                    to_send.push(i);
                }
                _ => {}
            }
        }
        if is_overdue {
            self.window.on_loss(now);
        }
        for i in to_send.into_iter().take(self.window.tiles().saturating_sub(in_flight)) {
            self.order += 1;
            self.counts.tiles += 1;
            self.counts.repeated += u64::from(self.pending[k].note_sent(i, self.order, now));
            tiles.push(self.tile(k, i));
        }
    }

    /// Tile `index` of the pending sample at position `k`.
    fn tile(&self, k: usize, index: usize) -> Tile {
        let oldest = self.pending.front().map_or(self.newest, |s| s.sequence);
        let after = match self.retention {
            Retention::Latched if k + 1 < self.pending.len() => AFTER_NEVER,
            Retention::Queue { .. } if k > 0 => self.pending[k - 1].sequence,
            _ => 0,
        };
        self.pending[k].tile(index, self.writer, oldest, after)
    }

    /// The position among the pending samples of the one that a reader should get next: of a queue
    /// the oldest that it lacks, of a latched topic the one that it is receiving, else the newest.
    fn wanted_by(&self, reader: &ReaderState) -> Option<usize> {
        let mut sequences = self.pending.iter().map(|s| s.sequence);
        match self.retention {
            Retention::Queue { .. } => sequences.position(|sequence| sequence > reader.done),
            Retention::Latched => {
                sequences.position(|sequence| reader.is_receiving(sequence)).or_else(|| {
                    let newest = self.pending.back()?;
                    (newest.sequence > reader.done).then(|| self.pending.len() - 1)
                })
            }
        }
    }

    /// Lets go of what every reader has; the newest sample of a latched topic stays.
    fn release(&mut self) {
        match self.retention {
            Retention::Queue { .. } => {
                let everywhere = self.readers.values().map(|r| r.done).min().unwrap_or(0);
                self.pending.retain(|s| s.sequence > everywhere);
            }
            Retention::Latched => {
                let newest = self.newest;
                let readers = &self.readers;
                self.pending.retain(|s| {
                    s.sequence == newest
                        || readers.values().any(|r| r.sequence == s.sequence && r.done < s.sequence)
                });
            }
        }
    }
}

#[cfg(test)]
mod tests;
