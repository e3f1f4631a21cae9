//! The reader's half of the protocol: which tile to take, and what to acknowledge.

use super::sample_assembly::{SampleAssembly, TileOutcome};
use super::tile::{ALL_WRITERS, EndpointId, Tile, TileAck};
use bytes::Bytes;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// How often a reader announces itself to all writers.
const ANNOUNCE_PERIOD: Duration = Duration::from_secs(1);
/// How often a reader announces itself until it has heard of a writer.
const FIRST_ANNOUNCE_PERIOD: Duration = Duration::from_millis(100);
/// How often a reader repeats its acknowledgement while a sample is incomplete and nothing arrives.
const ACK_REPEAT_PERIOD: Duration = Duration::from_millis(50);
/// A writer that sends nothing for longer in the middle of a sample is dead: the sample is given
/// up.
const WRITER_TIMEOUT: Duration = Duration::from_secs(30);
/// Largest number of writers that are remembered.
const MAX_WRITERS: usize = 64;

/// Counts of a reader since its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ReceiverCounts {
    /// Samples that were complete.
    pub(crate) samples: u64,
    /// Tiles and samples that did not fit their checksums.
    pub(crate) corrupt: u64,
    /// Samples that were not taken because they were too large or their tiles impossible.
    pub(crate) refused: u64,
}

/// The reader's state, without DDS, threads and a clock of its own.
pub(crate) struct TileReceiver {
    reader: EndpointId,
    limit: u64,
    writers: BTreeMap<EndpointId, WriterState>,
    last_announcement: Option<Instant>,
    pub(crate) counts: ReceiverCounts,
    /// Why samples were refused, for the log.
    pub(crate) complaints: Vec<String>,
}

/// What a reader knows of one writer.
struct WriterState {
    /// Sequence number of the newest sample that is complete or was refused.
    done: u64,
    assembly: Option<SampleAssembly>,
    last_heard: Instant,
    last_ack: Instant,
    /// Whether something has arrived that is not acknowledged.
    owes_ack: bool,
}

impl TileReceiver {
    /// A reader that refuses samples above `limit` bytes.
    pub(crate) fn new(reader: EndpointId, limit: u64) -> TileReceiver {
        TileReceiver {
            reader,
            limit,
            writers: BTreeMap::new(),
            last_announcement: None,
            counts: ReceiverCounts::default(),
            complaints: Vec::new(),
        }
    }

    /// Takes a tile; returns the sample if it is complete now. A reader that is `busy` starts no
    /// sample.
    pub(crate) fn on_tile(&mut self, tile: &Tile, busy: bool, now: Instant) -> Option<Bytes> {
        let writer = self.writers.entry(tile.writer).or_insert(WriterState {
            done: 0,
            assembly: None,
            last_heard: now,
            last_ack: now,
            owes_ack: true,
        });
        writer.last_heard = now;
        writer.owes_ack = true;
        if tile.sequence <= writer.done {
            return None;
        }
        if writer.assembly.as_ref().is_some_and(|a| a.sequence < tile.oldest) {
            writer.assembly = None;
        }
        if writer.assembly.is_none() && writer.done >= tile.after && !busy {
            match SampleAssembly::new(tile, self.limit) {
                Ok(assembly) => writer.assembly = Some(assembly),
                Err(reason) => {
                    writer.done = tile.sequence;
                    self.counts.refused += 1;
                    self.complaints.push(format!("sample {} refused: {reason}", tile.sequence));
                    return None;
                }
            }
        }
        let assembly = writer.assembly.as_mut().filter(|a| a.sequence == tile.sequence)?;
        if assembly.add(tile) == TileOutcome::Corrupt {
            self.counts.corrupt += 1;
        }
        if !assembly.is_complete() {
            return None;
        }
        match writer.assembly.take()?.finish() {
            Ok(bytes) => {
                writer.done = tile.sequence;
                self.counts.samples += 1;
                Some(bytes)
            }
            Err(empty) => {
                writer.assembly = Some(empty);
                self.counts.corrupt += 1;
                None
            }
        }
    }

    /// The acknowledgements to send now.
    pub(crate) fn poll(&mut self, busy: bool, now: Instant) -> Vec<TileAck> {
        let mut acks = Vec::new();
        self.forget_dead_writers(now);
        for (id, writer) in &mut self.writers {
            let is_repeat_due = writer.assembly.is_some()
                && now.duration_since(writer.last_ack) >= ACK_REPEAT_PERIOD;
            if writer.owes_ack || is_repeat_due {
                writer.owes_ack = false;
                writer.last_ack = now;
                acks.push(acknowledge(self.reader, *id, writer, busy));
            }
        }
        let period = if self.writers.is_empty() { FIRST_ANNOUNCE_PERIOD } else { ANNOUNCE_PERIOD };
        if self.last_announcement.is_none_or(|at| now.duration_since(at) >= period) {
            self.last_announcement = Some(now);
            acks.push(TileAck {
                reader: self.reader,
                writer: ALL_WRITERS,
                done: 0,
                sequence: 0,
                have: Vec::new(),
                busy,
            });
        }
        acks
    }

    /// Takes note that the application has taken a sample: every writer is told with the next poll.
    pub(crate) fn on_sample_taken(&mut self) {
        for writer in self.writers.values_mut() {
            writer.owes_ack = true;
        }
    }

    /// When to poll again if nothing is heard until then.
    pub(crate) fn next_poll(&self, now: Instant) -> Instant {
        let is_active = self.writers.values().any(|writer| writer.assembly.is_some());
        now + if is_active { ACK_REPEAT_PERIOD } else { FIRST_ANNOUNCE_PERIOD }
    }

    fn forget_dead_writers(&mut self, now: Instant) {
        for writer in self.writers.values_mut() {
            if now.duration_since(writer.last_heard) > WRITER_TIMEOUT {
                writer.assembly = None;
            }
        }
        while self.writers.len() > MAX_WRITERS {
            let oldest = self.writers.iter().min_by_key(|(_, writer)| writer.last_heard);
            let Some(id) = oldest.map(|(id, _)| *id) else { break };
            self.writers.remove(&id);
        }
    }
}

/// The acknowledgement for one writer.
fn acknowledge(reader: EndpointId, id: EndpointId, writer: &WriterState, busy: bool) -> TileAck {
    let (sequence, have) = match &writer.assembly {
        Some(assembly) => (assembly.sequence, assembly.have.bytes().to_vec()),
        None => (0, Vec::new()),
    };
    // A sample that has begun is taken in any case.
    let busy = busy && writer.assembly.is_none();
    TileAck { reader, writer: id, done: writer.done, sequence, have, busy }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::large_data::pending_sample::PendingSample;
    use crate::large_data::tile::MAX_TILE_BYTES;

    const READER: EndpointId = [9; 16];
    const WRITER: EndpointId = [1; 16];

    fn receiver() -> TileReceiver {
        TileReceiver::new(READER, 1 << 20)
    }

    fn tile(writer: EndpointId, sequence: u64, index: usize) -> Tile {
        let bytes = vec![sequence as u8; 2 * MAX_TILE_BYTES];
        PendingSample::new(sequence, bytes.into()).tile(index, writer, 1, 0)
    }

    #[test]
    fn a_reader_announces_itself_often_until_it_knows_a_writer() {
        let start = Instant::now();
        let mut receiver = receiver();
        let announced = receiver.poll(false, start);
        assert_eq!((announced.len(), announced[0].writer), (1, ALL_WRITERS));
        assert!(receiver.poll(false, start + FIRST_ANNOUNCE_PERIOD / 2).is_empty());
        let next = start + FIRST_ANNOUNCE_PERIOD;
        assert_eq!(receiver.poll(false, next).len(), 1);
        receiver.on_tile(&tile(WRITER, 1, 0), false, next);
        let acks = receiver.poll(false, next + FIRST_ANNOUNCE_PERIOD);
        assert!(acks.iter().all(|ack| ack.writer == WRITER), "{acks:?}");
    }

    #[test]
    fn an_acknowledgement_lists_the_tiles_and_repeats_until_the_sample_is_complete() {
        let start = Instant::now();
        let mut receiver = receiver();
        receiver.poll(false, start);
        assert!(receiver.on_tile(&tile(WRITER, 1, 1), false, start).is_none());
        let ack = receiver.poll(false, start).remove(0);
        assert_eq!((ack.done, ack.sequence, ack.have), (0, 1, vec![0b10]));
        assert!(receiver.poll(false, start + ACK_REPEAT_PERIOD / 2).is_empty());
        assert_eq!(receiver.poll(false, start + ACK_REPEAT_PERIOD).len(), 1);
        let sample = receiver.on_tile(&tile(WRITER, 1, 0), false, start).unwrap();
        assert_eq!(sample.len(), 2 * MAX_TILE_BYTES);
        let ack = receiver.poll(false, start + ACK_REPEAT_PERIOD).remove(0);
        assert_eq!((ack.done, ack.sequence, ack.have), (1, 0, vec![]));
        assert!(receiver.poll(false, start + 4 * ACK_REPEAT_PERIOD).is_empty());
    }

    #[test]
    fn a_busy_reader_starts_no_sample_but_finishes_one() {
        let now = Instant::now();
        let mut receiver = receiver();
        receiver.on_tile(&tile(WRITER, 1, 0), true, now);
        let ack = receiver.poll(true, now).remove(0);
        assert!(ack.busy && ack.have.is_empty());
        receiver.on_tile(&tile(WRITER, 1, 0), false, now);
        assert!(!receiver.poll(true, now).remove(0).busy, "it takes what has begun");
        assert!(receiver.on_tile(&tile(WRITER, 1, 1), true, now).is_some());
    }

    #[test]
    fn a_silent_writer_loses_its_sample_and_too_many_writers_push_the_oldest_out() {
        let start = Instant::now();
        let mut receiver = receiver();
        receiver.on_tile(&tile(WRITER, 1, 0), false, start);
        receiver.poll(false, start + WRITER_TIMEOUT);
        assert!(receiver.writers[&WRITER].assembly.is_some());
        receiver.poll(false, start + WRITER_TIMEOUT + Duration::from_millis(1));
        assert!(receiver.writers[&WRITER].assembly.is_none());
        for k in 0..MAX_WRITERS as u8 {
            receiver.on_tile(&tile([100 + k; 16], 1, 0), false, start + WRITER_TIMEOUT);
        }
        receiver.poll(false, start + WRITER_TIMEOUT);
        assert_eq!(receiver.writers.len(), MAX_WRITERS);
        assert!(!receiver.writers.contains_key(&WRITER));
    }

    /// The fields of a tile that its receiver reads, each set to a number.
    const FIELD_SETTERS: [fn(&mut Tile, u64); 8] = [
        |tile, number| tile.sequence = number,
        |tile, number| tile.oldest = number,
        |tile, number| tile.after = number,
        |tile, number| tile.total = number,
        |tile, number| tile.tile_size = number as u32,
        |tile, number| tile.index = number as u32,
        |tile, number| tile.checksum = number as u32,
        |tile, number| tile.sample_checksum = number as u32,
    ];

    #[test]
    fn damaged_tiles_never_make_a_wrong_sample_and_do_not_harm_other_writers() {
        // Numbers around which lengths, counts and offsets overflow.
        let numbers = [0, 1, 0xffff_ffff, 1 << 53, u64::MAX];
        let now = Instant::now();
        let good = [0, 1].map(|index| tile(WRITER, 1, index));
        let others = [0, 1].map(|index| tile([2; 16], 3, index));
        for (i, set_first) in FIELD_SETTERS.into_iter().enumerate() {
            for set_second in &FIELD_SETTERS[i..] {
                for (first, second) in numbers.iter().flat_map(|a| numbers.map(|b| (*a, b))) {
                    let mut receiver = receiver();
                    let mut damaged = good[0].clone();
                    set_first(&mut damaged, first);
                    set_second(&mut damaged, second);
                    let tiles = [&damaged, &good[0], &good[1]];
                    for sample in tiles.into_iter().filter_map(|t| receiver.on_tile(t, false, now))
                    {
                        assert!(sample.is_empty() || sample == vec![1; 2 * MAX_TILE_BYTES]);
                    }
                    receiver.poll(false, now);
                    assert!(receiver.on_tile(&others[0], false, now).is_none());
                    let sample = receiver.on_tile(&others[1], false, now);
                    assert!(sample.is_some_and(|sample| sample == vec![3; 2 * MAX_TILE_BYTES]));
                }
            }
        }
    }
}
