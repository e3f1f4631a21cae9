//! The sender alone, without a link.

use super::*;
use crate::large_data::tile::MAX_TILE_BYTES;

const WRITER: EndpointId = [1; 16];

fn sender(retention: Retention) -> TileSender {
    TileSender::new(WRITER, retention)
}

fn ack(reader: u8, writer: EndpointId, done: u64) -> TileAck {
    TileAck { reader: [reader; 16], writer, done, ..TileAck::default() }
}

fn two_tiles() -> Bytes {
    vec![7; 2 * MAX_TILE_BYTES].into()
}

#[test]
fn acknowledgements_of_other_writers_are_ignored() {
    let now = Instant::now();
    let mut sender = sender(Retention::Latched);
    sender.on_ack(ack(9, [2; 16], 0), now);
    assert_eq!(sender.readers(), 0);
    sender.on_ack(ack(9, ALL_WRITERS, 0), now);
    assert_eq!(sender.readers(), 1);
    sender.on_ack(ack(8, WRITER, 0), now);
    assert_eq!(sender.readers(), 2);
}

#[test]
fn without_readers_nothing_is_sent_and_everything_counts_as_delivered() {
    let now = Instant::now();
    let mut sender = sender(Retention::Queue { depth: 3 });
    assert_eq!((sender.newest(), sender.delivered()), (0, 0));
    assert_eq!([sender.push(two_tiles(), now), sender.push(two_tiles(), now)], [1, 2]);
    assert!(sender.poll(now).is_empty());
    assert_eq!((sender.newest(), sender.delivered()), (2, 2));
    assert!(sender.readers_without(2).is_empty());
}

#[test]
fn a_sample_is_released_when_every_reader_has_it() {
    let now = Instant::now();
    let mut sender = sender(Retention::Queue { depth: 1 });
    for reader in [8, 9] {
        sender.on_ack(ack(reader, ALL_WRITERS, 0), now);
    }
    sender.push(two_tiles(), now);
    assert!(!sender.make_room(false, now));
    sender.on_ack(ack(8, WRITER, 1), now);
    assert!(!sender.make_room(false, now));
    assert_eq!(sender.readers_without(1), [[9; 16]]);
    sender.on_ack(ack(9, WRITER, 1), now);
    assert!(sender.make_room(false, now));
    assert_eq!((sender.counts.missed, sender.counts.dropped), (0, 0));
}

#[test]
fn force_makes_room_at_the_cost_of_readers() {
    let now = Instant::now();
    let mut sender = sender(Retention::Queue { depth: 1 });
    sender.on_ack(ack(9, ALL_WRITERS, 0), now);
    sender.push(two_tiles(), now);
    assert!(!sender.make_room(false, now));
    assert!(sender.make_room(true, now));
    assert_eq!((sender.counts.missed, sender.counts.dropped), (1, 0));
}

#[test]
fn a_queue_of_depth_zero_holds_one_sample() {
    let now = Instant::now();
    let mut sender = sender(Retention::Queue { depth: 0 });
    assert!(sender.make_room(false, now));
    sender.push(two_tiles(), now);
    assert!(sender.make_room(false, now), "nobody reads");
    assert_eq!(sender.counts.dropped, 1);
}

#[test]
fn tiles_of_a_queue_say_which_sample_comes_before() {
    let now = Instant::now();
    let mut sender = sender(Retention::Queue { depth: 2 });
    sender.on_ack(ack(9, ALL_WRITERS, 0), now);
    sender.push(two_tiles(), now);
    sender.push(two_tiles(), now);
    let first = sender.poll(now);
    assert!(first.iter().all(|tile| (tile.sequence, tile.after, tile.oldest) == (1, 0, 1)));
    assert_eq!(first.iter().map(|tile| tile.index).collect::<Vec<_>>(), [0, 1]);
    // A second reader has the first sample already and wants the second one.
    sender.on_ack(ack(8, WRITER, 1), now);
    let second = sender.poll(now);
    assert!(!second.is_empty());
    assert!(second.iter().all(|tile| (tile.sequence, tile.after, tile.oldest) == (2, 1, 1)));
}

#[test]
fn an_older_latched_sample_is_finished_but_not_begun() {
    let now = Instant::now();
    let mut sender = sender(Retention::Latched);
    sender.on_ack(ack(9, ALL_WRITERS, 0), now);
    sender.push(two_tiles(), now);
    sender.poll(now);
    let has_first_tile = TileAck { sequence: 1, have: vec![1], ..ack(9, WRITER, 0) };
    sender.on_ack(has_first_tile, now);
    sender.push(two_tiles(), now);
    sender.on_ack(ack(8, ALL_WRITERS, 0), now);
    let overdue = now + Duration::from_millis(55);
    let tiles = sender.poll(overdue);
    let of_first = tiles.iter().filter(|tile| tile.sequence == 1);
    assert!(of_first.clone().all(|tile| tile.index == 1 && tile.after == AFTER_NEVER));
    assert_eq!(of_first.count(), 1);
    assert!(tiles.iter().any(|tile| tile.sequence == 2 && tile.after == 0));
}

#[test]
fn a_silent_reader_is_probed_with_announcements() {
    let start = Instant::now();
    let mut sender = sender(Retention::Latched);
    sender.on_ack(ack(9, ALL_WRITERS, 0), start);
    sender.push(two_tiles(), start);
    assert_eq!(sender.poll(start).len(), 2);
    let later = start + Duration::from_millis(200);
    let probes = sender.poll(later);
    assert_eq!((probes.len(), probes[0].index, probes[0].data.len()), (1, 2, 0));
    assert!(sender.poll(later + PROBE_PERIOD / 2).is_empty());
    assert_eq!(sender.poll(later + PROBE_PERIOD).len(), 1);
}

#[test]
fn a_reader_that_is_gone_holds_nothing_back() {
    let start = Instant::now();
    let mut sender = sender(Retention::Queue { depth: 1 });
    sender.on_ack(ack(9, ALL_WRITERS, 0), start);
    sender.push(two_tiles(), start);
    sender.poll(start + Duration::from_secs(11));
    assert_eq!(sender.readers(), 0);
    assert_eq!(sender.readers_without(1), [] as [EndpointId; 0]);
}

#[test]
fn polls_are_frequent_only_while_a_reader_lacks_something() {
    let now = Instant::now();
    let mut sender = sender(Retention::Latched);
    sender.on_ack(ack(9, ALL_WRITERS, 0), now);
    assert_eq!(sender.next_poll(now), now + IDLE_POLL_PERIOD);
    sender.push(two_tiles(), now);
    assert_eq!(sender.next_poll(now), now + ACTIVE_POLL_PERIOD);
    sender.on_ack(ack(9, WRITER, 1), now);
    assert_eq!(sender.next_poll(now), now + IDLE_POLL_PERIOD);
}
