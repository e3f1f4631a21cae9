//! Which samples slow, stopped, late and new readers get.

use super::simulated_link::*;
use crate::large_data::tile_sender::Retention;
use bytes::Bytes;
use std::time::Duration;
#[test]
fn a_stopped_reader_holds_up_nobody_and_comes_back() {
    let mut link = SimulatedLink::new(Retention::Queue { depth: 2 }, 3);
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
    let mut link = SimulatedLink::new(Retention::Queue { depth: 1 }, 2);
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
    // One on its way; of those that only the stopped reader lacks, the second is the first above
    // the limit.
    assert!((2..=3).contains(&pushed), "{pushed}");
    assert_eq!(link.sender.counts.missed, 0);
}

#[test]
fn a_busy_reader_loses_nothing() {
    let mut link = SimulatedLink::new(Retention::Queue { depth: 1 }, 2);
    link.steps(200);
    link.readers[1].busy = true;
    link.publish(&sample(0));
    link.steps(20_000);
    assert!(!link.sender.make_room(false, link.now), "it is waited for");
    assert!(link.readers[1].got.is_empty() && link.readers[0].got == samples(1));
    link.readers[1].busy = false;
    link.readers[1].receiver.on_sample_taken();
    link.publish(&sample(1));
    link.finish();
    assert!(link.readers.iter().all(|r| r.got == samples(2)));
}

#[test]
fn a_late_joiner_gets_the_newest_only() {
    let mut link = SimulatedLink::new(Retention::Latched, 0);
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
fn without_readers_a_queue_keeps_its_depth() {
    let mut link = SimulatedLink::new(Retention::Queue { depth: 2 }, 0);
    for s in samples(5) {
        link.publish(&s);
    }
    assert_eq!(link.sender.counts.dropped, 3);
    link.join();
    link.finish();
    assert!(link.readers[0].got == samples(5)[3..]);
}

#[test]
fn a_sample_above_the_limit_is_refused_and_holds_nothing_up() {
    let mut link = SimulatedLink::new(Retention::Queue { depth: 1 }, 1);
    link.steps(200);
    link.publish(&vec![0; LIMIT as usize + 1].into());
    link.publish(&sample(0));
    link.publish(&Bytes::new());
    link.finish();
    assert!(link.readers[0].got == [sample(0), Bytes::new()]);
    assert_eq!(link.readers[0].receiver.counts.refused, 1);
    assert!(link.readers[0].receiver.complaints[0].contains("limit"));
}
