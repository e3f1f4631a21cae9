//! A sample that a writer holds, and which of its tiles were sent when.

use super::tile::{EndpointId, MAX_TILE_BYTES, Tile, tile_count};
use bytes::Bytes;
use std::time::{Duration, Instant};

/// A tile that is not acknowledged within this time is sent again. This is far above the time of a
/// healthy answer (below a millisecond), so that a busy machine does not cause floods.
const RETRANSMIT_TIMEOUT: Duration = Duration::from_millis(50);

/// A sample that some reader may still lack.
pub(crate) struct PendingSample {
    /// Sequence number, from 1.
    pub(crate) sequence: u64,
    /// The serialized message.
    pub(crate) bytes: Bytes,
    /// CRC-32 of the bytes.
    pub(crate) checksum: u32,
    /// When readers that do not answer were probed last.
    pub(crate) last_probe: Option<Instant>,
    /// The last transmission of each tile.
    transmissions: Vec<Transmission>,
}

/// The last time that a tile was sent.
#[derive(Clone, Copy, Default)]
struct Transmission {
    /// `None` if the tile was never sent, or is known to be lost.
    at: Option<Instant>,
    /// Position of this transmission among all of the writer, from 1; 0 if the tile was never sent.
    order: u64,
}

/// Whether a tile should be sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum TileState {
    /// It was not sent yet, or is known to be lost.
    Unsent,
    /// It was sent and may still arrive.
    InFlight,
    /// It was sent and not acknowledged in time.
    Overdue,
}

impl PendingSample {
    pub(crate) fn new(sequence: u64, bytes: Bytes) -> PendingSample {
        let count = tile_count(bytes.len() as u64, MAX_TILE_BYTES as u32) as usize;
        let checksum = crc32fast::hash(&bytes);
        let transmissions = vec![Transmission::default(); count];
        PendingSample { sequence, bytes, checksum, last_probe: None, transmissions }
    }

    /// Number of tiles; 0 for an empty sample.
    pub(crate) fn tile_count(&self) -> usize {
        self.transmissions.len()
    }

    pub(crate) fn tile_state(&self, index: usize, now: Instant) -> TileState {
        match self.transmissions[index].at {
            None => TileState::Unsent,
            Some(at) if now.duration_since(at) < RETRANSMIT_TIMEOUT => TileState::InFlight,
            Some(_) => TileState::Overdue,
        }
    }

    /// Notes that tile `index` is sent, as transmission number `order` of the writer. Returns
    /// whether the tile was sent before.
    pub(crate) fn note_sent(&mut self, index: usize, order: u64, now: Instant) -> bool {
        let transmission = Transmission { at: Some(now), order };
        let previous = std::mem::replace(&mut self.transmissions[index], transmission);
        previous.order > 0
    }

    /// Marks those tiles as lost that a reader lacks although it has one that was sent later: tiles
    /// of one writer travel in order. Returns how many they are.
    pub(crate) fn detect_losses(&mut self, reader_has: impl Fn(usize) -> bool) -> usize {
        let arrived = (0..self.tile_count()).filter(|&i| reader_has(i));
        let Some(newest) = arrived.map(|i| self.transmissions[i].order).max() else { return 0 };
        let mut lost = 0;
        for (i, transmission) in self.transmissions.iter_mut().enumerate() {
            if transmission.at.is_some() && transmission.order < newest && !reader_has(i) {
                transmission.at = None;
                lost += 1;
            }
        }
        lost
    }

    /// Tile `index`. If `index` is the number of tiles, the tile holds no data and announces the
    /// sample only. For `oldest` and `after` see `puffer_msgs/msg/Tile`.
    pub(crate) fn tile(&self, index: usize, writer: EndpointId, oldest: u64, after: u64) -> Tile {
        let from = (index * MAX_TILE_BYTES).min(self.bytes.len());
        let to = (from + MAX_TILE_BYTES).min(self.bytes.len());
        let is_announcement = index >= self.tile_count();
        let data = if is_announcement { Vec::new() } else { self.bytes[from..to].to_vec() };
        Tile {
            writer,
            sequence: self.sequence,
            oldest,
            after,
            total: self.bytes.len() as u64,
            tile_size: MAX_TILE_BYTES as u32,
            index: index as u32,
            sample_checksum: self.checksum,
            checksum: crc32fast::hash(&data),
            data,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(length: usize) -> PendingSample {
        PendingSample::new(3, (0..length).map(|i| (i % 251) as u8).collect::<Vec<u8>>().into())
    }

    #[test]
    fn the_tiles_in_a_row_are_the_sample() {
        for length in [0, 1, MAX_TILE_BYTES, MAX_TILE_BYTES + 1, 2 * MAX_TILE_BYTES + 7] {
            let sample = sample(length);
            let tiles: Vec<Tile> =
                (0..sample.tile_count()).map(|i| sample.tile(i, [1; 16], 2, 1)).collect();
            assert_eq!(tiles.len(), length.div_ceil(MAX_TILE_BYTES));
            let bytes: Vec<u8> = tiles.iter().flat_map(|tile| tile.data.clone()).collect();
            assert!(bytes == sample.bytes[..], "{length}");
            assert!(tiles.iter().all(|tile| crc32fast::hash(&tile.data) == tile.checksum));
            let announcement = sample.tile(sample.tile_count(), [1; 16], 2, 1);
            assert!(announcement.data.is_empty() && announcement.total == length as u64);
        }
    }

    #[test]
    fn a_tile_is_overdue_when_its_acknowledgement_is() {
        let start = Instant::now();
        let mut sample = sample(MAX_TILE_BYTES);
        assert_eq!(sample.tile_state(0, start), TileState::Unsent);
        assert!(!sample.note_sent(0, 1, start));
        assert_eq!(sample.tile_state(0, start), TileState::InFlight);
        assert_eq!(sample.tile_state(0, start + RETRANSMIT_TIMEOUT), TileState::Overdue);
        assert!(sample.note_sent(0, 2, start + RETRANSMIT_TIMEOUT));
        assert_eq!(sample.tile_state(0, start + RETRANSMIT_TIMEOUT), TileState::InFlight);
    }

    #[test]
    fn a_gap_before_the_newest_arrival_is_a_loss() {
        let now = Instant::now();
        let mut sample = sample(4 * MAX_TILE_BYTES);
        for index in 0..3 {
            sample.note_sent(index, index as u64 + 1, now);
        }
        assert_eq!(sample.detect_losses(|_| false), 0, "nothing has arrived yet");
        // Tile 1 arrived: tile 0 was sent before it and is lost, tile 2 may still come.
        assert_eq!(sample.detect_losses(|index| index == 1), 1);
        let states = [0, 1, 2, 3].map(|index| sample.tile_state(index, now));
        let [unsent, in_flight] = [TileState::Unsent, TileState::InFlight];
        assert_eq!(states, [unsent, in_flight, in_flight, unsent]);
        assert_eq!(sample.detect_losses(|index| index == 1), 0, "a loss is counted once");
    }
}
