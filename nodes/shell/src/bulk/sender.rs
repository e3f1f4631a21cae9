//! The writer's half of the protocol: which tile to send when.

use super::held::{Flight, Held};
use super::member::Member;
use super::window::Window;
use super::wire::{EVERYONE, Id, Tile, TileAck};
use bytes::Bytes;
use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

/// How often readers that do not answer are asked.
const PROBE_EVERY: Duration = Duration::from_millis(100);
/// Bytes held beyond a queue's depth for readers that do not answer, while they are being judged: so long the others go
/// on.
const SPARE: usize = 48_000_000;
/// Tells a reader never to start with a sample: a newer one is there.
const NEVER: u64 = u64::MAX;

/// What a topic does with samples that have not gone out when the next one comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Only the newest counts (a mesh, a filtered cloud). It stays for readers that come later, and replaces an older
    /// one that nobody is receiving. Two samples are held at most.
    Latched,
    /// Each counts (scans). At most `depth` samples are held, those on their way included.
    Queue {
        /// Most samples held, at least 1.
        depth: usize,
    },
}

/// Counts of a writer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) tiles: u64,
    pub(crate) repeated: u64,
    /// Samples given up before every reader had them, and those that no reader had.
    pub(crate) missed: u64,
    pub(crate) dropped: u64,
}

/// The writer.
pub(crate) struct Sender {
    writer: Id,
    mode: Mode,
    held: VecDeque<Held>,
    members: BTreeMap<Id, Member>,
    /// Number of the newest sample.
    newest: u64,
    window: Window,
    order: u64,
    pub(crate) counts: Counts,
}

impl Sender {
    pub(crate) fn new(writer: Id, mode: Mode) -> Sender {
        Sender {
            writer,
            mode,
            held: VecDeque::new(),
            members: BTreeMap::new(),
            newest: 0,
            window: Window::new(),
            order: 0,
            counts: Counts::default(),
        }
    }

    /// Number of the newest sample, 0 if there was none.
    pub(crate) fn newest(&self) -> u64 {
        self.newest
    }

    pub(crate) fn readers(&self) -> usize {
        self.members.len()
    }

    /// The newest sample that every reader has.
    pub(crate) fn delivered(&self) -> u64 {
        self.members.values().map(|m| m.done).min().unwrap_or(self.newest)
    }

    /// Readers that lack sample `sequence`.
    pub(crate) fn missing(&self, sequence: u64) -> Vec<Id> {
        self.members.iter().filter(|(_, m)| m.done < sequence).map(|(id, _)| *id).collect()
    }

    /// Makes room for a sample, if need be at the cost of readers that do not answer, or with `force` of any; whether
    /// there is room now.
    pub(crate) fn make_room(&mut self, force: bool, now: Instant) -> bool {
        let Mode::Queue { depth } = self.mode else { return true };
        while self.held.len() >= depth.max(1) {
            let Some(first) = self.held.front() else { break };
            let lacks = |m: &Member| m.done < first.sequence;
            if self.members.is_empty() {
                self.counts.dropped += 1;
            } else if force || !self.members.values().any(|m| lacks(m) && !m.is_stuck(now)) {
                self.counts.missed += u64::from(self.members.values().any(lacks));
            } else {
                return self.goes_on_without_the_silent(depth.max(1), now);
            }
            self.held.pop_front();
        }
        true
    }

    /// Whether the readers that answer leave room for a sample, and what is held for the others alone is little enough.
    fn goes_on_without_the_silent(&self, depth: usize, now: Instant) -> bool {
        let answering: Vec<&Member> = self.members.values().filter(|m| !m.lags(now)).collect();
        let (theirs, spare): (Vec<&Held>, Vec<&Held>) =
            self.held.iter().partition(|h| answering.iter().any(|m| m.done < h.sequence));
        let spare: usize = spare.iter().map(|h| h.bytes.len()).sum();
        !answering.is_empty() && theirs.len() < depth && spare <= SPARE
    }

    /// Takes a sample; returns its number. There must be room.
    pub(crate) fn push(&mut self, bytes: Bytes, now: Instant) -> u64 {
        self.newest += 1;
        if self.mode == Mode::Latched {
            let kept = self.held.iter().find(|h| {
                let receiving = |m: &Member| {
                    m.sequence == h.sequence && m.done < h.sequence && !m.have.is_empty()
                };
                self.members.values().any(|m| receiving(m) && !m.lags(now))
            });
            let kept = kept.map(|h| h.sequence);
            self.held.retain(|h| Some(h.sequence) == kept);
        }
        self.held.push_back(Held::new(self.newest, bytes));
        self.newest
    }

    /// Takes what a reader says.
    pub(crate) fn hear(&mut self, ack: TileAck, now: Instant) {
        if ack.writer != self.writer && ack.writer != EVERYONE {
            return;
        }
        let writer = ack.writer;
        let member = self.members.entry(ack.reader).or_insert_with(|| Member::new(now));
        if writer == EVERYONE {
            member.hear(now);
            return;
        }
        let before = if member.sequence == ack.sequence { member.have.len() } else { 0 };
        member.acknowledge(ack, now);
        let (sequence, arrived) = (member.sequence, member.have.len().saturating_sub(before));
        if arrived > 0 {
            self.window.arrived(arrived);
        }
        let held = self.held.iter_mut().find(|h| h.sequence == sequence);
        if held.is_some_and(|held| held.find_lost(|i| member.have.has(i)) > 0) {
            self.window.lost(now);
        }
        self.release();
    }

    /// What to send now.
    pub(crate) fn poll(&mut self, now: Instant) -> Vec<Tile> {
        let before = self.members.len();
        self.members.retain(|_, m| !m.is_gone(now));
        if self.members.len() < before {
            self.release();
        }
        let mut tiles = Vec::new();
        for k in 0..self.held.len() {
            self.poll_sample(k, now, &mut tiles);
        }
        tiles
    }

    /// When to poll again if nothing is heard.
    pub(crate) fn wake(&self, now: Instant) -> Instant {
        let waits = self.members.values().any(|m| self.wanted(m).is_some());
        now + if waits { Duration::from_millis(10) } else { Duration::from_millis(500) }
    }

    fn poll_sample(&mut self, k: usize, now: Instant, tiles: &mut Vec<Tile>) {
        let wanting: Vec<Id> = self
            .members
            .iter()
            .filter(|(_, m)| !m.busy && self.wanted(m) == Some(k))
            .map(|(id, _)| *id)
            .collect();
        if wanting.is_empty() {
            return;
        }
        let active: Vec<Id> =
            wanting.iter().filter(|id| !self.members[*id].lags(now)).copied().collect();
        let first = tiles.len();
        if active.is_empty() || self.held[k].count() == 0 {
            self.probe(k, now, tiles);
        } else {
            self.send(k, &active, now, tiles);
        }
        if tiles.len() > first {
            for id in &wanting {
                if let Some(member) = self.members.get_mut(id) {
                    member.ask(now);
                }
            }
        }
    }

    fn probe(&mut self, k: usize, now: Instant, tiles: &mut Vec<Tile>) {
        let held = &mut self.held[k];
        if held.probed.is_none_or(|at| now.duration_since(at) >= PROBE_EVERY) {
            held.probed = Some(now);
            let announcement = held.count();
            tiles.push(self.tile(k, announcement));
        }
    }

    fn send(&mut self, k: usize, active: &[Id], now: Instant, tiles: &mut Vec<Tile>) {
        let sequence = self.held[k].sequence;
        let mut flying = 0;
        let mut wanted = Vec::new();
        let mut overdue = false;
        for i in 0..self.held[k].count() {
            if active.iter().all(|id| self.members[id].has(sequence, i)) {
                continue;
            }
            match self.held[k].flight(i, now) {
                Flight::Flying => flying += 1,
                flight if wanted.len() < self.window.tiles() => {
                    overdue |= flight == Flight::Overdue;
                    wanted.push(i);
                }
                _ => {}
            }
        }
        if overdue {
            self.window.lost(now);
        }
        for i in wanted.into_iter().take(self.window.tiles().saturating_sub(flying)) {
            self.order += 1;
            self.counts.tiles += 1;
            self.counts.repeated += u64::from(self.held[k].send(i, self.order, now));
            tiles.push(self.tile(k, i));
        }
    }

    fn tile(&self, k: usize, index: usize) -> Tile {
        let oldest = self.held.front().map_or(self.newest, |h| h.sequence);
        let after = match self.mode {
            Mode::Latched if k + 1 < self.held.len() => NEVER,
            Mode::Queue { .. } if k > 0 => self.held[k - 1].sequence,
            _ => 0,
        };
        self.held[k].tile(index, self.writer, oldest, after)
    }

    /// The sample that a reader should get, as its place among those held.
    fn wanted(&self, member: &Member) -> Option<usize> {
        let lacks = |h: &Held| h.sequence > member.done;
        match self.mode {
            Mode::Queue { .. } => self.held.iter().position(lacks),
            Mode::Latched => {
                let started = |h: &Held| h.sequence == member.sequence && !member.have.is_empty();
                self.held
                    .iter()
                    .position(|h| lacks(h) && started(h))
                    .or_else(|| self.held.back().is_some_and(lacks).then(|| self.held.len() - 1))
            }
        }
    }

    /// Lets go of what every reader has; the newest sample of a latched topic stays.
    fn release(&mut self) {
        match self.mode {
            Mode::Queue { .. } => {
                let everywhere = self.members.values().map(|m| m.done).min().unwrap_or(0);
                self.held.retain(|h| h.sequence > everywhere);
            }
            Mode::Latched => {
                let newest = self.newest;
                let members = &self.members;
                self.held.retain(|h| {
                    h.sequence == newest
                        || members.values().any(|m| m.sequence == h.sequence && m.done < h.sequence)
                });
            }
        }
    }
}
