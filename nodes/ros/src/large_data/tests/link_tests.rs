//! What the link loses and spoils, and malformed messages.

use super::simulated_link::*;
use crate::large_data::congestion_window::MAX_TILES_IN_FLIGHT;
use crate::large_data::tile::{Tile, TileAck};
use crate::large_data::tile_receiver::TileReceiver;
use crate::large_data::tile_sender::{Retention, TileSender};
use std::time::Instant;
#[test]
fn all_samples_arrive_in_order_whatever_is_lost() {
    for loses in [0, 5, 40] {
        let mut link = SimulatedLink::new(Retention::Queue { depth: 2 }, 3);
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
    let mut link = SimulatedLink::new(Retention::Queue { depth: 1 }, 1);
    link.steps(200);
    for s in samples(4) {
        link.publish(&s);
        link.finish();
    }
    assert!(
        (1..=MAX_TILES_IN_FLIGHT as usize).contains(&link.most_tiles_at_once),
        "{}",
        link.most_tiles_at_once
    );
    // Without answers nothing but the window goes out, until a tile is overdue.
    link.readers[0].stopped = true;
    link.publish(&sample(4));
    let before = link.sender.counts.tiles;
    link.steps(40);
    assert!(link.sender.counts.tiles - before <= MAX_TILES_IN_FLIGHT as u64);
}

#[test]
fn spoiled_tiles_come_again_and_are_never_handed_on() {
    let mut link = SimulatedLink::new(Retention::Queue { depth: 1 }, 2);
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
    let mut sender = TileSender::new(WRITER, Retention::Latched);
    let mut receiver = TileReceiver::new([9; 16], LIMIT);
    for ack in receiver.poll(false, now) {
        sender.on_ack(ack, now);
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
            if let Some(got) = receiver.on_tile(&tile, false, now) {
                assert!(spoil.is_none() && got == sample(1));
                assert_eq!(receiver.counts.corrupt, 1);
                return;
            }
        }
        for ack in receiver.poll(false, now) {
            sender.on_ack(ack, now);
        }
    }
    panic!("the sample did not come again");
}

#[test]
fn a_writer_that_is_faster_than_its_link_still_delivers() {
    let mut link = SimulatedLink::new(Retention::Latched, 1);
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
fn a_restarted_writer_starts_anew() {
    let mut link = SimulatedLink::new(Retention::Latched, 1);
    link.steps(200);
    link.publish(&sample(0));
    link.step();
    assert!(link.readers[0].got.is_empty());
    link.sender = TileSender::new([2; 16], Retention::Latched);
    link.steps(1500);
    link.publish(&sample(1));
    link.finish();
    assert!(link.readers[0].got == [sample(1)]);
}

#[test]
fn nonsense_does_no_harm() {
    let now = Instant::now();
    let mut receiver = TileReceiver::new([9; 16], LIMIT);
    let mut sender = TileSender::new(WRITER, Retention::Latched);
    sender.push(sample(0), now);
    let mut chance = Chance(3);
    for _ in 0..20_000 {
        let tile = Tile {
            writer: [chance.number(3) as u8; 16],
            sequence: chance.number(4),
            oldest: chance.number(4),
            after: chance.number(4),
            total: chance.number(9) * 1000,
            tile_size: chance.number(3) as u32 * 1000,
            index: chance.number(9) as u32,
            sample_checksum: chance.number(2) as u32,
            checksum: chance.number(2) as u32,
            data: vec![0; chance.number(2) as usize * 1000],
        };
        assert_eq!(
            receiver
                .on_tile(&tile, false, now)
                .map(|s| crc32fast::hash(&s))
                .unwrap_or(tile.sample_checksum),
            tile.sample_checksum
        );
        let ack = TileAck {
            reader: [chance.number(3) as u8; 16],
            writer: WRITER,
            done: chance.number(4),
            sequence: chance.number(4),
            have: vec![255; chance.number(9) as usize],
            busy: chance.number(2) == 1,
        };
        sender.on_ack(ack, now);
        sender.poll(now);
        receiver.poll(false, now);
    }
}
