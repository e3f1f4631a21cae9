//! A writer and readers over a link that loses and spoils what it carries, in time that the tests
//! step.

use crate::large_data::tile::{EndpointId, MAX_TILE_BYTES, Tile};
use crate::large_data::tile_receiver::TileReceiver;
use crate::large_data::tile_sender::{Retention, TileSender};
use bytes::Bytes;
use std::time::{Duration, Instant};

pub(super) const WRITER: EndpointId = [1; 16];
pub(super) const LIMIT: u64 = 1 << 25;
pub(super) const STEP: Duration = Duration::from_millis(1);

/// Numbers that look random, the same in every run.
pub(super) struct Chance(pub(super) u64);

impl Chance {
    /// A number below `bound`, which is at most 256.
    pub(super) fn number(&mut self, bound: u64) -> u64 {
        (0..8).fold(0, |n, _| n * 2 + u64::from(self.occurs(50))) % bound
    }

    /// True in `percent` of 100 calls.
    pub(super) fn occurs(&mut self, percent: u64) -> bool {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % 100 < percent
    }
}

/// A reader and the samples that it has got.
pub(super) struct SimulatedReader {
    pub(super) receiver: TileReceiver,
    pub(super) got: Vec<Bytes>,
    pub(super) stopped: bool,
    pub(super) busy: bool,
}

/// A writer and its readers, with a link that loses and spoils so many percent of what it carries.
pub(super) struct SimulatedLink {
    pub(super) sender: TileSender,
    pub(super) readers: Vec<SimulatedReader>,
    pub(super) chance: Chance,
    pub(super) loses: u64,
    pub(super) spoils: u64,
    pub(super) now: Instant,
    pub(super) most_tiles_at_once: usize,
}

impl SimulatedLink {
    pub(super) fn new(mode: Retention, readers: usize) -> SimulatedLink {
        let mut link = SimulatedLink {
            sender: TileSender::new(WRITER, mode),
            readers: Vec::new(),
            chance: Chance(7),
            loses: 0,
            spoils: 0,
            now: Instant::now(),
            most_tiles_at_once: 0,
        };
        for _ in 0..readers {
            link.join();
        }
        link
    }

    pub(super) fn join(&mut self) {
        let id = [10 + self.readers.len() as u8; 16];
        let receiver = TileReceiver::new(id, LIMIT);
        self.readers.push(SimulatedReader {
            receiver,
            got: Vec::new(),
            stopped: false,
            busy: false,
        });
    }

    pub(super) fn step(&mut self) {
        self.now += STEP;
        let tiles = self.sender.poll(self.now);
        self.most_tiles_at_once = self.most_tiles_at_once.max(tiles.len());
        for reader in self.readers.iter_mut().filter(|r| !r.stopped) {
            for tile in &tiles {
                if self.chance.occurs(self.loses) {
                    continue;
                }
                let mut tile: Tile = tile.clone();
                if self.chance.occurs(self.spoils) && !tile.data.is_empty() {
                    tile.data[3] ^= 64;
                }
                reader.got.extend(reader.receiver.on_tile(&tile, reader.busy, self.now));
            }
            for ack in reader.receiver.poll(reader.busy, self.now) {
                if !self.chance.occurs(self.loses) {
                    self.sender.on_ack(ack, self.now);
                }
            }
        }
    }

    pub(super) fn steps(&mut self, count: usize) {
        for _ in 0..count {
            self.step();
        }
    }

    /// Publishes as soon as there is room; fails the test after a minute of the link's time.
    pub(super) fn publish(&mut self, sample: &Bytes) {
        for _ in 0..60_000 {
            if self.sender.make_room(false, self.now) {
                self.sender.push(sample.clone(), self.now);
                return;
            }
            self.step();
        }
        panic!("no room within a minute");
    }

    /// Steps until every reader that runs has the newest sample.
    pub(super) fn finish(&mut self) {
        for _ in 0..60_000 {
            let behind = self.sender.readers_without(self.sender.newest());
            let is_waiting = behind.iter().any(|id| !self.readers[usize::from(id[0]) - 10].stopped);
            if !is_waiting && self.sender.readers() >= self.running() {
                return;
            }
            self.step();
        }
        panic!("not delivered within a minute");
    }

    pub(super) fn running(&self) -> usize {
        self.readers.iter().filter(|r| !r.stopped).count()
    }
}

/// Sample `k`: several tiles and an odd rest.
pub(super) fn sample(k: usize) -> Bytes {
    (0..4 * MAX_TILE_BYTES + 1000 + k)
        .map(|i| (i * (k + 3) % 251) as u8)
        .collect::<Vec<u8>>()
        .into()
}

pub(super) fn samples(count: usize) -> Vec<Bytes> {
    (0..count).map(sample).collect()
}
