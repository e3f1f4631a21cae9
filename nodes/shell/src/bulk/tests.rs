//! The protocol over a link that loses and spoils what it carries, in time that the tests step.

use super::receiver::Receiver;
use super::sender::{Mode, Sender};
use super::window::MOST;
use super::wire::{Id, TILE_BYTES, Tile, TileAck};
use bytes::Bytes;
use std::time::{Duration, Instant};

const WRITER: Id = [1; 16];
const LIMIT: u64 = 1 << 25;
const STEP: Duration = Duration::from_millis(1);

/// Numbers that look random, the same in every run.
struct Chance(u64);

impl Chance {
    fn of(&mut self, percent: u64) -> bool {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % 100 < percent
    }
}

struct Reader {
    receiver: Receiver,
    got: Vec<Bytes>,
    stopped: bool,
    busy: bool,
}

struct Link {
    sender: Sender,
    readers: Vec<Reader>,
    chance: Chance,
    loses: u64,
    spoils: u64,
    now: Instant,
    most_tiles_at_once: usize,
}

impl Link {
    fn new(mode: Mode, readers: usize) -> Link {
        let mut link = Link {
            sender: Sender::new(WRITER, mode),
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

    fn join(&mut self) {
        let id = [10 + self.readers.len() as u8; 16];
        let receiver = Receiver::new(id, LIMIT);
        self.readers.push(Reader { receiver, got: Vec::new(), stopped: false, busy: false });
    }

    fn step(&mut self) {
        self.now += STEP;
        let tiles = self.sender.poll(self.now);
        self.most_tiles_at_once = self.most_tiles_at_once.max(tiles.len());
        for reader in self.readers.iter_mut().filter(|r| !r.stopped) {
            for tile in &tiles {
                if self.chance.of(self.loses) {
                    continue;
                }
                let mut tile: Tile = tile.clone();
                if self.chance.of(self.spoils) && !tile.data.is_empty() {
                    tile.data[3] ^= 64;
                }
                reader.got.extend(reader.receiver.take(&tile, reader.busy, self.now));
            }
            for ack in reader.receiver.poll(reader.busy, self.now) {
                if !self.chance.of(self.loses) {
                    self.sender.hear(ack, self.now);
                }
            }
        }
    }

    fn steps(&mut self, count: usize) {
        for _ in 0..count {
            self.step();
        }
    }

    /// Publishes as soon as there is room; fails the test after a minute of the link's time.
    fn publish(&mut self, sample: &Bytes) {
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
    fn finish(&mut self) {
        for _ in 0..60_000 {
            let behind = self.sender.missing(self.sender.newest());
            let runs = |id: &Id| !self.readers[usize::from(id[0]) - 10].stopped;
            if !behind.iter().any(runs) && self.sender.readers() >= self.running() {
                return;
            }
            self.step();
        }
        panic!("not delivered within a minute");
    }

    fn running(&self) -> usize {
        self.readers.iter().filter(|r| !r.stopped).count()
    }
}

/// Sample `k`: several tiles and an odd rest.
fn sample(k: usize) -> Bytes {
    (0..4 * TILE_BYTES + 1000 + k).map(|i| (i * (k + 3) % 251) as u8).collect::<Vec<u8>>().into()
}

fn samples(count: usize) -> Vec<Bytes> {
    (0..count).map(sample).collect()
}

#[test]
fn all_samples_arrive_in_order_whatever_is_lost() {
    for loses in [0, 5, 40] {
        let mut link = Link::new(Mode::Queue { depth: 2 }, 3);
        link.loses = loses;
        link.steps(1500);
        for s in samples(6) {
            link.publish(&s);
        }
        link.finish();
        for reader in &link.readers {
            assert!(reader.got == samples(6), "{loses} % lost");
        }
        assert_eq!((link.sender.counts.missed, link.sender.counts.dropped), (0, 0));
        if loses == 0 {
            assert_eq!(link.sender.counts.repeated, 0);
        }
    }
}

#[test]
fn few_tiles_are_in_flight() {
    let mut link = Link::new(Mode::Queue { depth: 1 }, 1);
    link.steps(200);
    for s in samples(4) {
        link.publish(&s);
        link.finish();
    }
    assert!((1..=MOST as usize).contains(&link.most_tiles_at_once), "{}", link.most_tiles_at_once);
    // Without answers nothing but the window goes out, until a tile is overdue.
    link.readers[0].stopped = true;
    link.publish(&sample(4));
    let before = link.sender.counts.tiles;
    link.steps(40);
    assert!(link.sender.counts.tiles - before <= MOST as u64);
}

#[test]
fn spoiled_tiles_come_again_and_are_never_handed_on() {
    let mut link = Link::new(Mode::Queue { depth: 1 }, 2);
    link.spoils = 30;
    link.steps(200);
    for s in samples(5) {
        link.publish(&s);
    }
    link.finish();
    for reader in &link.readers {
        assert!(reader.got == samples(5));
        assert!(reader.receiver.counts.corrupt > 0);
    }
}

#[test]
fn a_spoiled_sample_is_fetched_again() {
    let now = Instant::now();
    let mut sender = Sender::new(WRITER, Mode::Latched);
    let mut receiver = Receiver::new([9; 16], LIMIT);
    for ack in receiver.poll(false, now) {
        sender.hear(ack, now);
    }
    sender.push(sample(1), now);
    let mut spoil = Some(());
    for k in 0..2000 {
        let now = now + STEP * k;
        for mut tile in sender.poll(now) {
            if tile.index == 2 && spoil.take().is_some() {
                // Wrong, but its own checksum fits: only the sample's tells.
                tile.data[0] ^= 1;
                tile.checksum = crc32fast::hash(&tile.data);
            }
            if let Some(got) = receiver.take(&tile, false, now) {
                assert!(spoil.is_none() && got == sample(1));
                assert_eq!(receiver.counts.corrupt, 1);
                return;
            }
        }
        for ack in receiver.poll(false, now) {
            sender.hear(ack, now);
        }
    }
    panic!("the sample did not come again");
}

#[test]
fn a_stopped_reader_holds_up_nobody_and_comes_back() {
    let mut link = Link::new(Mode::Queue { depth: 2 }, 3);
    link.steps(200);
    link.publish(&sample(0));
    link.finish();
    link.readers[2].stopped = true;
    let since = link.now;
    for s in &samples(8)[1..] {
        link.publish(s);
    }
    link.finish();
    let took = link.now.duration_since(since);
    assert!(took < Duration::from_millis(200), "the others wait for no verdict on it: {took:?}");
    assert_eq!(link.sender.counts.missed, 0, "it may still answer");
    link.readers[2].stopped = false;
    link.finish();
    assert!(link.readers.iter().all(|r| r.got == samples(8)), "it was slow, and has everything");
    link.readers[2].stopped = true;
    link.publish(&sample(8));
    link.steps(1500);
    for s in &samples(12)[9..] {
        link.publish(s);
    }
    link.finish();
    for reader in &link.readers[..2] {
        assert!(reader.got == samples(12));
    }
    assert!(link.sender.counts.missed > 0);
    link.readers[2].stopped = false;
    link.steps(1500);
    link.publish(&sample(12));
    link.finish();
    assert!(link.readers[2].got.last() == Some(&sample(12)));
    assert!(link.readers[0].got == samples(13));
}

#[test]
fn little_is_held_for_a_reader_that_is_being_judged() {
    let mut link = Link::new(Mode::Queue { depth: 1 }, 2);
    link.steps(200);
    link.readers[1].stopped = true;
    let large = Bytes::from(vec![5; 30_000_000]);
    let mut pushed = 0;
    for _ in 0..900 {
        if link.sender.make_room(false, link.now) {
            link.sender.push(large.clone(), link.now);
            pushed += 1;
        }
        link.step();
    }
    // One on its way; of those that only the stopped reader lacks, the second is the first above the limit.
    assert!((2..=3).contains(&pushed), "{pushed}");
    assert_eq!(link.sender.counts.missed, 0);
}

#[test]
fn a_busy_reader_loses_nothing() {
    let mut link = Link::new(Mode::Queue { depth: 1 }, 2);
    link.steps(200);
    link.readers[1].busy = true;
    link.publish(&sample(0));
    link.steps(20_000);
    assert!(!link.sender.make_room(false, link.now), "it is waited for");
    assert!(link.readers[1].got.is_empty() && link.readers[0].got == samples(1));
    link.readers[1].busy = false;
    link.readers[1].receiver.free();
    link.publish(&sample(1));
    link.finish();
    assert!(link.readers.iter().all(|r| r.got == samples(2)));
}

#[test]
fn a_late_joiner_gets_the_newest_only() {
    let mut link = Link::new(Mode::Latched, 0);
    for s in samples(3) {
        link.publish(&s);
    }
    link.join();
    link.finish();
    link.steps(2000);
    assert!(link.readers[0].got == [sample(2)]);
    // While the first is in the middle of a sample, a newer one comes, and then another reader.
    link.publish(&sample(3));
    link.step();
    assert_eq!(link.readers[0].got.len(), 1);
    link.publish(&sample(4));
    link.join();
    link.finish();
    link.steps(2000);
    assert!(link.readers[0].got == [sample(2), sample(3), sample(4)], "what has begun is finished");
    assert!(link.readers[1].got == [sample(4)]);
}

#[test]
fn a_writer_that_is_faster_than_its_link_still_delivers() {
    let mut link = Link::new(Mode::Latched, 1);
    link.loses = 30;
    link.steps(200);
    for k in 0..100 {
        link.publish(&sample(k));
        link.steps(5);
    }
    link.finish();
    let got = &link.readers[0].got;
    assert!(got.len() > 2 && got.last() == Some(&sample(99)), "{}", got.len());
    assert!(got.windows(2).all(|w| w[0].len() < w[1].len()), "never backwards");
}

#[test]
fn without_readers_a_queue_keeps_its_depth() {
    let mut link = Link::new(Mode::Queue { depth: 2 }, 0);
    for s in samples(5) {
        link.publish(&s);
    }
    assert_eq!(link.sender.counts.dropped, 3);
    link.join();
    link.finish();
    assert!(link.readers[0].got == samples(5)[3..]);
}

#[test]
fn a_restarted_writer_starts_anew() {
    let mut link = Link::new(Mode::Latched, 1);
    link.steps(200);
    link.publish(&sample(0));
    link.step();
    assert!(link.readers[0].got.is_empty());
    link.sender = Sender::new([2; 16], Mode::Latched);
    link.steps(1500);
    link.publish(&sample(1));
    link.finish();
    assert!(link.readers[0].got == [sample(1)]);
}

#[test]
fn a_sample_above_the_limit_is_refused_and_holds_nothing_up() {
    let mut link = Link::new(Mode::Queue { depth: 1 }, 1);
    link.steps(200);
    link.publish(&vec![0; LIMIT as usize + 1].into());
    link.publish(&sample(0));
    link.publish(&Bytes::new());
    link.finish();
    assert!(link.readers[0].got == [sample(0), Bytes::new()]);
    assert_eq!(link.readers[0].receiver.counts.refused, 1);
    assert!(link.readers[0].receiver.complaints[0].contains("limit"));
}

#[test]
fn nonsense_does_no_harm() {
    let now = Instant::now();
    let mut receiver = Receiver::new([9; 16], LIMIT);
    let mut sender = Sender::new(WRITER, Mode::Latched);
    sender.push(sample(0), now);
    let mut chance = Chance(3);
    let mut number = |most: u64| (0..8).fold(0, |n, _| n * 2 + u64::from(chance.of(50))) % most;
    for _ in 0..20_000 {
        let tile = Tile {
            writer: [number(3) as u8; 16],
            sequence: number(4),
            oldest: number(4),
            after: number(4),
            total: number(9) * 1000,
            tile_size: number(3) as u32 * 1000,
            index: number(9) as u32,
            sample_checksum: number(2) as u32,
            checksum: number(2) as u32,
            data: vec![0; number(2) as usize * 1000],
        };
        assert_eq!(
            receiver
                .take(&tile, false, now)
                .map(|s| crc32fast::hash(&s))
                .unwrap_or(tile.sample_checksum),
            tile.sample_checksum
        );
        let ack = TileAck {
            reader: [number(3) as u8; 16],
            writer: WRITER,
            done: number(4),
            sequence: number(4),
            have: vec![255; number(9) as usize],
            busy: number(2) == 1,
        };
        sender.hear(ack, now);
        sender.poll(now);
        receiver.poll(false, now);
    }
}
