//! The reader's half of the protocol: which tile to take, and what to answer.

use super::assembly::{Assembly, Put};
use super::wire::{EVERYONE, Id, Tile, TileAck};
use bytes::Bytes;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// How often a reader says that it is there.
const HELLO_EVERY: Duration = Duration::from_secs(1);
/// ... until it has heard of a writer.
const HELLO_EVERY_AT_FIRST: Duration = Duration::from_millis(100);
/// How often it says what it has when nothing arrives.
const REMIND_EVERY: Duration = Duration::from_millis(50);
/// A writer that falls silent for so long in the middle of a sample is dead.
const DEAD_AFTER: Duration = Duration::from_secs(30);
/// Writers that are remembered.
const MOST_WRITERS: usize = 64;

/// Counts of a reader.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) samples: u64,
    pub(crate) corrupt: u64,
    pub(crate) refused: u64,
}

/// The reader.
pub(crate) struct Receiver {
    reader: Id,
    limit: u64,
    writers: BTreeMap<Id, Incoming>,
    hello: Option<Instant>,
    pub(crate) counts: Counts,
    /// Why samples were refused, to be told to the user.
    pub(crate) complaints: Vec<String>,
}

/// What comes from one writer.
struct Incoming {
    done: u64,
    assembly: Option<Assembly>,
    heard: Instant,
    answered: Instant,
    /// Something has arrived that is not answered.
    owes: bool,
}

impl Receiver {
    /// Samples above `limit` bytes are refused.
    pub(crate) fn new(reader: Id, limit: u64) -> Receiver {
        Receiver {
            reader,
            limit,
            writers: BTreeMap::new(),
            hello: None,
            counts: Counts::default(),
            complaints: Vec::new(),
        }
    }

    /// Takes a tile; returns a sample if it is complete. A reader that is `busy` starts no sample.
    pub(crate) fn take(&mut self, tile: &Tile, busy: bool, now: Instant) -> Option<Bytes> {
        let fresh = Incoming { done: 0, assembly: None, heard: now, answered: now, owes: true };
        let from = self.writers.entry(tile.writer).or_insert(fresh);
        from.heard = now;
        from.owes = true;
        if tile.sequence <= from.done {
            return None;
        }
        if from.assembly.as_ref().is_some_and(|a| a.sequence < tile.oldest) {
            from.assembly = None;
        }
        if from.assembly.is_none() && from.done >= tile.after && !busy {
            match Assembly::new(tile, self.limit) {
                Ok(assembly) => from.assembly = Some(assembly),
                Err(reason) => {
                    from.done = tile.sequence;
                    self.counts.refused += 1;
                    self.complaints.push(format!("sample {} refused: {reason}", tile.sequence));
                    return None;
                }
            }
        }
        let assembly = from.assembly.as_mut().filter(|a| a.sequence == tile.sequence)?;
        if assembly.put(tile) == Put::Corrupt {
            self.counts.corrupt += 1;
        }
        if !assembly.is_complete() {
            return None;
        }
        match from.assembly.take()?.finish() {
            Ok(bytes) => {
                from.done = tile.sequence;
                self.counts.samples += 1;
                Some(bytes)
            }
            Err(again) => {
                from.assembly = Some(again);
                self.counts.corrupt += 1;
                None
            }
        }
    }

    /// What to answer now.
    pub(crate) fn poll(&mut self, busy: bool, now: Instant) -> Vec<TileAck> {
        let mut acks = Vec::new();
        self.forget(now);
        for (writer, from) in &mut self.writers {
            let remind =
                from.assembly.is_some() && now.duration_since(from.answered) >= REMIND_EVERY;
            if from.owes || remind {
                from.owes = false;
                from.answered = now;
                acks.push(answer(self.reader, *writer, from, busy));
            }
        }
        let every = if self.writers.is_empty() { HELLO_EVERY_AT_FIRST } else { HELLO_EVERY };
        if self.hello.is_none_or(|at| now.duration_since(at) >= every) {
            self.hello = Some(now);
            acks.push(TileAck {
                reader: self.reader,
                writer: EVERYONE,
                done: 0,
                sequence: 0,
                have: Vec::new(),
                busy,
            });
        }
        acks
    }

    /// The application has taken something: everybody shall know.
    pub(crate) fn free(&mut self) {
        for from in self.writers.values_mut() {
            from.owes = true;
        }
    }

    /// When to poll again if nothing is heard.
    pub(crate) fn wake(&self, now: Instant) -> Instant {
        let waits = self.writers.values().any(|from| from.assembly.is_some());
        now + if waits { REMIND_EVERY } else { HELLO_EVERY_AT_FIRST }
    }

    fn forget(&mut self, now: Instant) {
        for from in self.writers.values_mut() {
            if now.duration_since(from.heard) > DEAD_AFTER {
                from.assembly = None;
            }
        }
        while self.writers.len() > MOST_WRITERS {
            let oldest = self.writers.iter().min_by_key(|(_, from)| from.heard).map(|(id, _)| *id);
            let Some(id) = oldest else { break };
            self.writers.remove(&id);
        }
    }
}

fn answer(reader: Id, writer: Id, from: &Incoming, busy: bool) -> TileAck {
    let (sequence, have) = match &from.assembly {
        Some(assembly) => (assembly.sequence, assembly.have.bytes().to_vec()),
        None => (0, Vec::new()),
    };
    // A sample that has begun is taken in any case.
    let busy = busy && from.assembly.is_none();
    TileAck { reader, writer, done: from.done, sequence, have, busy }
}
