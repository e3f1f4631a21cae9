//! What a writer knows of one reader.

use super::bits::Bits;
use super::wire::TileAck;
use std::time::{Duration, Instant};

/// A reader that leaves tiles unanswered for so long no longer holds the others up: far above the time of a healthy
/// answer (below a millisecond), and above that of one repetition. It loses nothing by that.
pub(crate) const LAGS_AFTER: Duration = Duration::from_millis(60);
/// A reader that does not answer for so long loses what there is no room for.
pub(crate) const STUCK_AFTER: Duration = Duration::from_secs(1);
/// A reader that has not been heard for so long is gone; readers speak up every second.
pub(crate) const GONE_AFTER: Duration = Duration::from_secs(10);

/// A reader.
#[derive(Debug)]
pub(crate) struct Member {
    /// Newest sample that it has.
    pub(crate) done: u64,
    /// The sample that it assembles, and the tiles that it has of it.
    pub(crate) sequence: u64,
    pub(crate) have: Bits,
    /// Its application has not taken what came before.
    pub(crate) busy: bool,
    heard: Instant,
    /// Since when something sent to it is unanswered.
    unanswered: Option<Instant>,
}

impl Member {
    pub(crate) fn new(now: Instant) -> Member {
        Member {
            done: 0,
            sequence: 0,
            have: Bits::default(),
            busy: false,
            heard: now,
            unanswered: None,
        }
    }

    /// It is there, and says no more.
    pub(crate) fn hear(&mut self, now: Instant) {
        self.heard = now;
    }

    /// It says what it has.
    pub(crate) fn acknowledge(&mut self, ack: TileAck, now: Instant) {
        self.heard = now;
        self.unanswered = None;
        self.done = self.done.max(ack.done);
        self.sequence = ack.sequence;
        self.have = Bits::from_bytes(ack.have);
        self.busy = ack.busy;
    }

    /// Something was sent to it that it has to answer.
    pub(crate) fn ask(&mut self, now: Instant) {
        self.unanswered.get_or_insert(now);
    }

    pub(crate) fn lags(&self, now: Instant) -> bool {
        self.silent_for(now) > LAGS_AFTER
    }

    pub(crate) fn is_stuck(&self, now: Instant) -> bool {
        self.silent_for(now) > STUCK_AFTER
    }

    pub(crate) fn is_gone(&self, now: Instant) -> bool {
        now.duration_since(self.heard) > GONE_AFTER
    }

    /// Whether it has tile `index` of sample `sequence`.
    pub(crate) fn has(&self, sequence: u64, index: usize) -> bool {
        self.sequence == sequence && self.have.has(index)
    }

    fn silent_for(&self, now: Instant) -> Duration {
        self.unanswered.map_or(Duration::ZERO, |since| now.duration_since(since))
    }
}
