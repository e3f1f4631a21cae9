//! What a writer knows of one of its readers.

use super::tile::TileAck;
use super::tile_set::TileSet;
use std::time::{Duration, Instant};

/// A reader that leaves tiles unacknowledged for longer does not hold the other readers up. This is
/// far above the time of a healthy answer (below a millisecond), and above that of one
/// retransmission. The reader loses nothing by that.
pub(crate) const LAG_TIMEOUT: Duration = Duration::from_millis(60);
/// A reader that leaves tiles unacknowledged for longer loses the samples for which there is no
/// room.
pub(crate) const STUCK_TIMEOUT: Duration = Duration::from_secs(1);
/// A reader that has sent nothing for longer is gone; readers announce themselves every second.
pub(crate) const READER_LEASE: Duration = Duration::from_secs(10);

/// The state of one reader, from its acknowledgements.
#[derive(Debug)]
pub(crate) struct ReaderState {
    /// Sequence number of the newest sample that the reader has completely.
    pub(crate) done: u64,
    /// Sequence number of the sample that the reader assembles.
    pub(crate) sequence: u64,
    /// Tiles of that sample that the reader has.
    pub(crate) have: TileSet,
    /// Whether the reader's application has not taken earlier samples yet.
    pub(crate) busy: bool,
    last_heard: Instant,
    /// Since when something sent to the reader is unacknowledged.
    unanswered_since: Option<Instant>,
}

impl ReaderState {
    pub(crate) fn new(now: Instant) -> ReaderState {
        ReaderState {
            done: 0,
            sequence: 0,
            have: TileSet::default(),
            busy: false,
            last_heard: now,
            unanswered_since: None,
        }
    }

    /// Takes note that the reader has announced itself, which acknowledges nothing.
    pub(crate) fn on_announcement(&mut self, now: Instant) {
        self.last_heard = now;
    }

    /// Takes note of an acknowledgement.
    pub(crate) fn on_ack(&mut self, ack: TileAck, now: Instant) {
        self.last_heard = now;
        self.unanswered_since = None;
        self.done = self.done.max(ack.done);
        self.sequence = ack.sequence;
        self.have = TileSet::from_bytes(ack.have);
        self.busy = ack.busy;
    }

    /// Takes note that something was sent that the reader has to acknowledge.
    pub(crate) fn expect_ack(&mut self, now: Instant) {
        self.unanswered_since.get_or_insert(now);
    }

    pub(crate) fn is_lagging(&self, now: Instant) -> bool {
        self.unanswered_for(now) > LAG_TIMEOUT
    }

    pub(crate) fn is_stuck(&self, now: Instant) -> bool {
        self.unanswered_for(now) > STUCK_TIMEOUT
    }

    pub(crate) fn is_gone(&self, now: Instant) -> bool {
        now.duration_since(self.last_heard) > READER_LEASE
    }

    /// Whether the reader has tile `index` of sample `sequence`.
    pub(crate) fn has_tile(&self, sequence: u64, index: usize) -> bool {
        self.sequence == sequence && self.have.contains(index)
    }

    /// Whether the reader is in the middle of sample `sequence`.
    pub(crate) fn is_receiving(&self, sequence: u64) -> bool {
        self.sequence == sequence && self.done < sequence && !self.have.is_empty()
    }

    fn unanswered_for(&self, now: Instant) -> Duration {
        self.unanswered_since.map_or(Duration::ZERO, |since| now.duration_since(since))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ack(done: u64, sequence: u64, have: Vec<u8>) -> TileAck {
        TileAck { done, sequence, have, ..TileAck::default() }
    }

    #[test]
    fn silence_counts_from_the_first_unanswered_tile_until_the_next_acknowledgement() {
        let start = Instant::now();
        let mut reader = ReaderState::new(start);
        assert!(!reader.is_lagging(start + Duration::from_secs(5)), "nothing was sent to it");
        reader.expect_ack(start);
        reader.expect_ack(start + LAG_TIMEOUT);
        assert!(!reader.is_lagging(start + LAG_TIMEOUT));
        assert!(reader.is_lagging(start + 2 * LAG_TIMEOUT));
        assert!(!reader.is_stuck(start + STUCK_TIMEOUT));
        assert!(reader.is_stuck(start + 2 * STUCK_TIMEOUT));
        reader.on_announcement(start + 2 * STUCK_TIMEOUT);
        assert!(reader.is_stuck(start + 2 * STUCK_TIMEOUT), "an announcement acknowledges nothing");
        reader.on_ack(ack(0, 1, vec![1]), start + 2 * STUCK_TIMEOUT);
        assert!(!reader.is_lagging(start + 3 * STUCK_TIMEOUT));
    }

    #[test]
    fn a_reader_is_gone_when_it_has_sent_nothing_for_its_lease() {
        let start = Instant::now();
        let mut reader = ReaderState::new(start);
        assert!(!reader.is_gone(start + READER_LEASE));
        assert!(reader.is_gone(start + 2 * READER_LEASE));
        reader.on_announcement(start + READER_LEASE);
        assert!(!reader.is_gone(start + 2 * READER_LEASE));
    }

    #[test]
    fn an_older_acknowledgement_does_not_take_back_a_complete_sample() {
        let now = Instant::now();
        let mut reader = ReaderState::new(now);
        reader.on_ack(ack(5, 6, vec![0b101]), now);
        reader.on_ack(ack(4, 6, vec![0b001]), now);
        assert_eq!(reader.done, 5);
        assert!(reader.has_tile(6, 0) && !reader.has_tile(6, 2) && !reader.has_tile(5, 0));
        assert!(reader.is_receiving(6) && !reader.is_receiving(5));
        reader.on_ack(ack(6, 6, vec![0b001]), now);
        assert!(!reader.is_receiving(6), "the sample is complete");
    }
}
