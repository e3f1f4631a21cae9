//! A bag recorded from topics, and played to others.

use crate::common::{SOON, eventually, free_domain, node};
use puffer_msgs::rosgraph_msgs::msg::Clock;
use puffer_msgs::sensor_msgs::msg::PointCloud2;
use puffer_msgs::{Interface, cdr};
use puffer_ros::bag::{
    BagMessage, BagReader, BagWriter, Player, Recording, TopicRoute, receive_topics,
};
use puffer_ros::large_data::{Delivery, Retention};
use puffer_ros::{NoParams, QosProfile, Stamp};
use std::path::Path;
use tokio::sync::mpsc::Receiver;
use tokio::time::timeout;

const CLOUD: usize = 3_000_000;

fn topics() -> [TopicRoute; 3] {
    [
        TopicRoute::samples("/ticks", Clock::TYPE_NAME, QosProfile::Standard),
        TopicRoute::samples("/latched", Clock::TYPE_NAME, QosProfile::Latched),
        TopicRoute::tiles("/points", PointCloud2::TYPE_NAME, false),
    ]
}

fn tick(k: i32) -> Clock {
    Clock { clock: puffer_msgs::builtin_interfaces::msg::Time { sec: k, nanosec: 7 } }
}

fn cloud(k: u8) -> PointCloud2 {
    let data = (0..CLOUD).map(|i| (i % 251) as u8 ^ k).collect();
    PointCloud2 { width: CLOUD as u32, data, ..PointCloud2::default() }
}

async fn take(messages: &mut Receiver<BagMessage>, count: usize) -> Vec<BagMessage> {
    let mut all = Vec::new();
    while all.len() < count {
        let next = timeout(SOON, messages.recv()).await;
        all.push(next.unwrap_or_else(|_| panic!("{} messages only", all.len())).unwrap());
    }
    all
}

/// The messages of a topic.
fn decode_topic<M: Interface>(all: &[BagMessage], topic: &str) -> Vec<M> {
    all.iter().filter(|m| &*m.topic == topic).map(|m| m.decode().unwrap()).collect()
}

fn put<M: Interface>(bag: &mut BagWriter, topic: &str, message: &M, millis: i64) {
    let at = Stamp::from_nanos(millis * 1_000_000);
    bag.write(topic, M::TYPE_NAME, &cdr::to_bytes(message).unwrap(), at, at).unwrap();
}

fn bag(path: &Path) -> BagReader {
    let mut bag = BagWriter::create(path).unwrap();
    for entry in topics() {
        bag.add_topic(&entry.topic, &entry.type_name, entry.profile()).unwrap();
    }
    put(&mut bag, "/latched", &tick(-1), 0);
    for k in 0..5 {
        let at = 100 * i64::from(k);
        put(&mut bag, "/ticks", &tick(k), at);
        put(&mut bag, "/points", &cloud(k as u8), at);
    }
    put(&mut bag, "/unwanted", &tick(9), 50);
    bag.finish().unwrap();
    BagReader::open(path).unwrap()
}

fn ticks() -> Vec<Clock> {
    (0..5).map(tick).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_published_is_recorded_unread() {
    let domain = free_domain();
    let sender = node::<NoParams>("sender", domain).await;
    let latched = sender.publisher::<Clock>("/latched", QosProfile::Latched).unwrap();
    latched.publish(&tick(-1)).unwrap();
    let plain = sender.publisher::<Clock>("/ticks", QosProfile::Standard).unwrap();
    let points = sender.large_data_publisher("/points", Retention::Queue { depth: 4 }).unwrap();

    let recorder = node::<NoParams>("recorder", domain).await;
    let mut messages = receive_topics(&recorder, &topics()).unwrap();
    plain.wait_for_readers(1, SOON).await.unwrap();
    points.wait_for_readers(1, SOON).await.unwrap();
    let before = Stamp::wall();
    for k in 0..5 {
        plain.publish(&tick(k)).unwrap();
        points.publish_message(&cloud(k as u8)).await.unwrap();
    }
    let all = take(&mut messages, 11).await;
    assert_eq!(decode_topic::<Clock>(&all, "/ticks"), ticks());
    assert_eq!(decode_topic::<Clock>(&all, "/latched"), [tick(-1)]);
    let clouds: Vec<PointCloud2> = decode_topic(&all, "/points");
    assert!(clouds == (0..5).map(cloud).collect::<Vec<_>>());
    assert!(all.iter().all(|m| m.bytes[..4] == [0, 1, 0, 0] && m.log_time <= Stamp::wall()));
    assert!(all.iter().filter(|m| &*m.topic == "/ticks").all(|m| m.log_time >= before));

    recorder.stop().stop();
    assert!(timeout(SOON, messages.recv()).await.unwrap().is_none(), "the recording ends");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_bag_is_played_with_its_timing_to_those_who_listen() {
    let folder = tempfile::tempdir().unwrap();
    let bag = bag(&folder.path().join("run.mcap"));
    let domain = free_domain();
    let listener = node::<NoParams>("listener", domain).await;
    let mut heard = listener.subscribe::<Clock>("/ticks", QosProfile::Standard).unwrap();
    let clouds = listener.large_data_subscribe::<PointCloud2>("/points", Delivery::Every).unwrap();

    let speaker = node::<NoParams>("speaker", domain).await;
    let player = Player::new(&speaker, &topics()).unwrap();
    let error = player.wait_for_readers(std::time::Duration::from_millis(1)).await.unwrap_err();
    assert!(error.to_string().contains("nobody came to read /latched"), "{error}");
    let mut late = listener.subscribe::<Clock>("/latched", QosProfile::LatchedSub).unwrap();
    player.wait_for_readers(SOON).await.unwrap();

    let taken = tokio::spawn(async move {
        let mut all = Vec::new();
        for _ in 0..5 {
            all.push(timeout(SOON, clouds.next()).await.unwrap().unwrap());
        }
        all
    });
    let begun = std::time::Instant::now();
    let mut asked = 0;
    let hold_up = async |_: &BagMessage| {
        asked += 1;
        if asked == 2 {
            tokio::time::sleep(std::time::Duration::from_millis(300)).await;
        }
        Ok(())
    };
    let count = player.play(bag.messages(&[]).unwrap(), Some(0.5), hold_up).await.unwrap();
    assert_eq!((count, asked), (11, 11), "all but the topic that is not named");
    // The last message lies 0.4 s after the first, and it is played at half the speed; and it was
    // held up.
    assert!(begun.elapsed().as_secs_f64() >= 1.1);
    player.flush(SOON).await.unwrap();
    for k in 0..5 {
        assert_eq!(heard.next_within(SOON).await.unwrap(), tick(k));
    }
    assert_eq!(late.next_within(SOON).await.unwrap(), tick(-1));
    assert!(taken.await.unwrap() == (0..5).map(cloud).collect::<Vec<_>>());

    let refuse = async |_: &BagMessage| Err(anyhow::anyhow!("not yet"));
    let refused = player.play(bag.messages(&[]).unwrap(), None, refuse).await.unwrap_err();
    assert_eq!(refused.to_string(), "not yet");
    let free = async |_: &BagMessage| Ok(());
    assert!(player.play(bag.messages(&[]).unwrap(), Some(0.0), free).await.is_err());
    speaker.stop().stop();
    assert_eq!(player.play(bag.messages(&[]).unwrap(), Some(1.0), free).await.unwrap(), 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recording_is_readable_while_it_goes_on_and_whole_when_it_ends() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let domain = free_domain();
    let sender = node::<NoParams>("sender", domain).await;
    let plain = sender.publisher::<Clock>("/ticks", QosProfile::Standard).unwrap();
    let points = sender.large_data_publisher("/points", Retention::Queue { depth: 4 }).unwrap();
    let recorder = node::<NoParams>("recorder", domain).await;
    let bag = BagWriter::create(&path).unwrap();
    let recording = Recording::start(&recorder, &topics(), bag).unwrap();
    plain.wait_for_readers(1, SOON).await.unwrap();
    points.wait_for_readers(1, SOON).await.unwrap();
    points.publish_message(&cloud(1)).await.unwrap();
    for k in 0..5 {
        plain.publish(&tick(k)).unwrap();
    }
    // Quiet from here on: nothing but the clock of the recorder brings the messages to the file.
    eventually("all messages are in the file", || {
        BagReader::open(&path).unwrap().info().count == 6
    })
    .await;
    assert_eq!(BagReader::open(&path).unwrap().info().damage.len(), 1);

    recorder.stop().stop();
    assert_eq!(timeout(SOON, recording.finished()).await.unwrap().unwrap(), 6);
    let bag = BagReader::open(&path).unwrap();
    assert!(bag.info().damage.is_empty(), "{:?}", bag.info());
    let all: Vec<BagMessage> = bag.messages(&[]).unwrap().map(|m| m.unwrap()).collect();
    assert_eq!(decode_topic::<Clock>(&all, "/ticks"), ticks());
    assert!(decode_topic::<PointCloud2>(&all, "/points") == [cloud(1)]);
    let profiles: Vec<QosProfile> = bag.info().topics.iter().map(|t| t.profile()).collect();
    assert_eq!(profiles, [QosProfile::Latched, QosProfile::Standard, QosProfile::Standard]);
}
