//! Bulk transport through nodes.

// The lints spare test functions only, not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;

use common::{SOON, free_domain, node_with};
use puffer_msgs::sensor_msgs::msg::PointCloud2;
use puffer_shell::bulk::{Delivery, Mode};
use puffer_shell::{NoParams, RosArgs};

#[tokio::test(flavor = "multi_thread")]
async fn clouds_larger_than_a_socket_buffer_arrive_whole_and_in_order() {
    let args = RosArgs::default().with_domain(free_domain());
    let sensor = node_with::<NoParams>("sensor", args.clone()).await;
    let args = args.with_remap("points", "/sensor/points");
    let mapper = node_with::<NoParams>("mapper", args).await;
    let publisher = sensor.bulk_publisher("~/points", Mode::Queue { depth: 3 }).unwrap();
    let subscription = mapper.bulk_subscribe::<PointCloud2>("points", Delivery::Every).unwrap();
    publisher.wait_for_readers(1, SOON).await.unwrap();
    let cloud = |number: u32| PointCloud2 {
        width: number,
        data: (0..2_000_000).map(|i| ((i + number) % 251) as u8).collect(),
        ..Default::default()
    };
    for number in 0..3 {
        publisher.publish_message(&cloud(number)).await.unwrap();
    }
    for number in 0..3 {
        let got = tokio::time::timeout(SOON, subscription.next()).await.unwrap().unwrap();
        assert!(got == cloud(number), "cloud {number} is another one");
    }
    publisher.flush(SOON).await.unwrap();
}
