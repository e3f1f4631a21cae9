//! The transport of large data over real DDS: several participants in one process, each with a
//! context of its own.

use puffer_msgs::std_msgs::msg::Header;
use puffer_ros::large_data::{
    Delivery, LargeDataError, LargeDataPublisher, LargeDataSubscription, Retention,
};
use ros2_client::{Context, MessageTypeName, Name, Node, NodeName, NodeOptions};
use rustdds::DomainParticipantBuilder;
use std::time::Duration;
use tokio::time::timeout;

/// Far above what is needed, for a machine that does other things too.
const LONG: Duration = Duration::from_secs(60);
/// What a stock machine grants.
const STOCK_BUFFER: usize = 212_992;

/// A participant of its own.
struct Peer {
    node: Node,
    context: Context,
}

impl Peer {
    fn new(domain: u16, name: &str) -> Peer {
        let participant = DomainParticipantBuilder::new(domain)
            .socket_receive_buffer_size(STOCK_BUFFER)
            .build()
            .unwrap();
        let context = Context::from_domain_participant(participant).unwrap();
        let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
        let node = context.new_node(NodeName::new("/", name).unwrap(), options).unwrap();
        Peer { node, context }
    }

    fn publisher(&mut self, topic: &str, mode: Retention) -> LargeDataPublisher {
        LargeDataPublisher::new(&mut self.node, topic, mode).unwrap()
    }

    fn reader(&mut self, topic: &str, delivery: Delivery) -> LargeDataSubscription<Header> {
        LargeDataSubscription::new(&mut self.node, topic, delivery).unwrap()
    }
}

/// A domain that nobody uses, another for each test.
fn domain() -> u16 {
    puffer_ros::domain::find_free().unwrap()
}

fn message(k: i32, size: usize) -> Header {
    let mut header = Header::default();
    header.stamp.sec = k;
    header.frame_id =
        (0..size).map(|i| char::from(b'a' + ((i / 7 + k as usize) % 26) as u8)).collect();
    header
}

fn kind() -> MessageTypeName {
    MessageTypeName::new("std_msgs", "Header")
}

async fn next(reader: &LargeDataSubscription<Header>) -> Header {
    timeout(LONG, reader.next()).await.expect("nothing came").unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn large_messages_arrive_whole_and_in_order_at_every_reader() {
    let domain = domain();
    let (mut a, mut b, mut c) =
        (Peer::new(domain, "a"), Peer::new(domain, "b"), Peer::new(domain, "c"));
    let publisher = a.publisher("/points", Retention::Queue { depth: 2 });
    let readers = [b.reader("/points", Delivery::Every), c.reader("/points", Delivery::Every)];
    publisher.wait_for_readers(2, LONG).await.unwrap();
    let send = async {
        for k in 0..4 {
            publisher.publish_message(&message(k, 3_000_000)).await.unwrap();
        }
        publisher.flush(LONG).await.unwrap();
    };
    let [first, second] = readers;
    tokio::join!(send, read_four("b", first), read_four("c", second));
    assert_eq!((publisher.stats().published, publisher.stats().missed), (4, 0));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_late_joiner_gets_the_newest_of_two_writers_and_a_restarted_reader_again() {
    let domain = domain();
    let (mut a, mut b) = (Peer::new(domain, "a"), Peer::new(domain, "b"));
    let first = a.publisher("/mesh", Retention::Latched);
    let second = b.publisher("/mesh", Retention::Latched);
    for k in 0..3 {
        first.publish_message(&message(k, 500_000)).await.unwrap();
        second.publish_message(&message(10 + k, 500_000)).await.unwrap();
    }
    for round in 0..2 {
        let mut late = Peer::new(domain, "late");
        let reader = late.reader("/mesh", Delivery::Every);
        let mut stamps = [next(&reader).await.stamp.sec, next(&reader).await.stamp.sec];
        stamps.sort_unstable();
        assert_eq!(stamps, [2, 12], "round {round}");
        let more = timeout(Duration::from_secs(2), reader.next()).await;
        assert!(more.is_err(), "round {round}: more came");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn flush_and_waiting_say_who_is_missing() {
    let domain = domain();
    let (mut a, mut b) = (Peer::new(domain, "a"), Peer::new(domain, "b"));
    let publisher = a.publisher("/points", Retention::Queue { depth: 8 });
    let nobody = publisher.wait_for_readers(1, Duration::from_millis(100)).await.unwrap_err();
    assert!(nobody.to_string().contains("/points: 0 of 1 readers"), "{nobody}");
    publisher.flush(Duration::from_millis(100)).await.unwrap();
    // Two samples wait at the reader's application, which takes none: the third is not accepted.
    let reader = b.reader("/points", Delivery::Every);
    publisher.wait_for_readers(1, LONG).await.unwrap();
    for k in 0..3 {
        publisher.publish_message(&message(k, 100_000)).await.unwrap();
    }
    match publisher.flush(Duration::from_secs(4)).await {
        Err(LargeDataError::Missing { readers: 1, missing, .. }) => assert_eq!(missing.len(), 1),
        other => panic!("{other:?}"),
    }
    assert_eq!(publisher.stats().delivered, 2);
    for k in 0..3 {
        assert!(next(&reader).await == message(k, 100_000));
    }
    publisher.flush(LONG).await.unwrap();
    let nonsense =
        LargeDataPublisher::new(&mut a.node, "no/../name", Retention::Latched).err().unwrap();
    assert!(nonsense.to_string().contains("no/../name"), "{nonsense}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn outsiders_read_and_write_the_named_topic() {
    let domain = domain();
    let (mut a, mut b, mut outside) =
        (Peer::new(domain, "a"), Peer::new(domain, "b"), Peer::new(domain, "outside"));
    let publisher = a
        .publisher("/cloud", Retention::Latched)
        .with_whole_messages(&a.context.domain_participant(), &kind(), true)
        .unwrap();
    let tiles = b
        .reader("/cloud", Delivery::Every)
        .with_whole_messages(&b.context.domain_participant(), &kind())
        .unwrap();
    publisher.publish_message(&message(1, 50_000)).await.unwrap();
    assert!(next(&tiles).await == message(1, 50_000));

    let quality = ros2_client::qos::QosProfile::subscription_default()
        .reliability_reliable(ros2_client::qos::WhenFull::DEFAULT)
        .durability(ros2_client::qos::Durability::TransientLocal);
    let name = Name::parse("/cloud").unwrap();
    let topic = outside.node.create_topic(&name, kind(), &quality).unwrap();
    let plain_reader = outside.node.create_subscription::<Header>(&topic, None).unwrap();
    let whole = timeout(LONG, plain_reader.async_take()).await.expect("no whole message").unwrap();
    assert!(whole.0 == message(1, 50_000));
    let twice = timeout(Duration::from_secs(2), tiles.next()).await;
    assert!(twice.is_err(), "the whole message came to the reader of tiles as well");

    let plain_writer = outside.node.create_publisher::<Header>(&topic, None).unwrap();
    let plain = message(2, 50_000);
    plain_writer.publish(plain.clone()).unwrap();
    assert!(next(&tiles).await == plain);
}

async fn read_four(reader: &str, subscription: LargeDataSubscription<Header>) {
    for k in 0..4 {
        assert!(next(&subscription).await == message(k, 3_000_000), "message {k} at {reader}");
    }
    assert_eq!(subscription.stats().samples, 4);
}
