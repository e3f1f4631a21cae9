//! A sample that a writer holds, and which of its tiles were sent when.

use super::wire::{TILE_BYTES, Tile, tile_count};
use bytes::Bytes;
use std::time::{Duration, Instant};

/// A tile that is not acknowledged for so long is sent again. Far above the time of a healthy answer (below a
/// millisecond), so that a busy machine does not cause floods.
const AGAIN_AFTER: Duration = Duration::from_millis(50);

/// A sample.
pub(crate) struct Held {
    pub(crate) sequence: u64,
    pub(crate) bytes: Bytes,
    pub(crate) checksum: u32,
    /// When readers that do not answer were asked last.
    pub(crate) probed: Option<Instant>,
    sent: Vec<Sent>,
}

/// The last time that a tile was sent.
#[derive(Clone, Copy, Default)]
struct Sent {
    at: Option<Instant>,
    /// Number of this sending among all of the writer, from 1; 0 = never sent.
    order: u64,
}

/// Whether a tile should be sent.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Flight {
    /// Not sent yet.
    Fresh,
    /// May still arrive.
    Flying,
    /// Sent and not acknowledged in time.
    Overdue,
}

impl Held {
    pub(crate) fn new(sequence: u64, bytes: Bytes) -> Held {
        let count = tile_count(bytes.len() as u64, TILE_BYTES as u32) as usize;
        let checksum = crc32fast::hash(&bytes);
        Held { sequence, bytes, checksum, probed: None, sent: vec![Sent::default(); count] }
    }

    /// Number of tiles.
    pub(crate) fn count(&self) -> usize {
        self.sent.len()
    }

    pub(crate) fn flight(&self, index: usize, now: Instant) -> Flight {
        match self.sent[index].at {
            None => Flight::Fresh,
            Some(at) if now.duration_since(at) < AGAIN_AFTER => Flight::Flying,
            Some(_) => Flight::Overdue,
        }
    }

    /// Notes that tile `index` is sent; whether it was before.
    pub(crate) fn send(&mut self, index: usize, order: u64, now: Instant) -> bool {
        let before = std::mem::replace(&mut self.sent[index], Sent { at: Some(now), order });
        before.order > 0
    }

    /// Takes as lost what `has` lacks although something sent later has arrived: tiles of one writer travel in order.
    /// Returns how many these are.
    pub(crate) fn find_lost(&mut self, has: impl Fn(usize) -> bool) -> usize {
        let newest = (0..self.count()).filter(|&i| has(i)).map(|i| self.sent[i].order).max();
        let Some(newest) = newest else { return 0 };
        let mut lost = 0;
        for (i, sent) in self.sent.iter_mut().enumerate() {
            if sent.at.is_some() && sent.order < newest && !has(i) {
                sent.at = None;
                lost += 1;
            }
        }
        lost
    }

    /// Tile `index`, or an announcement if it is the number of tiles.
    pub(crate) fn tile(&self, index: usize, writer: [u8; 16], oldest: u64, after: u64) -> Tile {
        let from = (index * TILE_BYTES).min(self.bytes.len());
        let to = (from + TILE_BYTES).min(self.bytes.len());
        let data = if index < self.count() { self.bytes[from..to].to_vec() } else { Vec::new() };
        Tile {
            writer,
            sequence: self.sequence,
            oldest,
            after,
            total: self.bytes.len() as u64,
            tile_size: TILE_BYTES as u32,
            index: index as u32,
            sample_checksum: self.checksum,
            checksum: crc32fast::hash(&data),
            data,
        }
    }
}
