//! Topics between two nodes over DDS: names, late joiners, logs, time, transforms.

use crate::common::{SOON, eventually, free_domain, node, node_with};
use puffer_core::geometry::Pose;
use puffer_msgs::diagnostic_msgs::msg::DiagnosticArray;
use puffer_msgs::rcl_interfaces::msg::Log;
use puffer_msgs::rosgraph_msgs::msg::Clock;
use puffer_msgs::std_msgs::msg::Header;
use puffer_ros::{NoParams, QosProfile, RosArgs, Stamp, Transform};
use std::time::Duration;

fn header(frame: &str) -> Header {
    Header { frame_id: frame.to_owned(), ..Default::default() }
}

#[tokio::test(flavor = "multi_thread")]
async fn names_are_remapped_and_namespaced_on_both_sides() {
    let domain = free_domain();
    let args = RosArgs::parse_with(
        "--ros-args -r __ns:=/cell -r __node:=left -r out:=/wire".split(' ').map(str::to_owned),
        |_| None,
    );
    let left = node_with::<NoParams>("talker", args.unwrap().with_domain(domain)).await;
    let right = node::<NoParams>("listener", domain).await;
    assert_eq!(left.full_name(), "/cell/left");
    let publisher = left.publisher::<Header>("out", QosProfile::Standard).unwrap();
    let private = left.publisher::<Header>("~/status", QosProfile::Standard).unwrap();
    assert_eq!((publisher.topic(), private.topic()), ("/wire", "/cell/left/status"));
    let mut heard = right.subscribe::<Header>("/wire", QosProfile::Standard).unwrap();
    let mut status = right.subscribe::<Header>("/cell/left/status", QosProfile::Standard).unwrap();
    publisher.wait_for_readers(1, SOON).await.unwrap();
    private.wait_for_readers(1, SOON).await.unwrap();
    heard.wait_for_writer(SOON).await.unwrap();
    status.wait_for_writer(SOON).await.unwrap();
    for number in 0..20 {
        publisher.publish(&header(&number.to_string())).unwrap();
    }
    private.publish(&header("fine")).unwrap();
    for number in 0..20 {
        assert_eq!(heard.next_within(SOON).await.unwrap().frame_id, number.to_string());
    }
    assert_eq!(status.next_within(SOON).await.unwrap().frame_id, "fine");
    assert!(heard.try_next().is_none());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_late_joiner_gets_what_is_latched() {
    let domain = free_domain();
    let talker = node::<NoParams>("talker", domain).await;
    let latched = talker.publisher::<Header>("mesh", QosProfile::Latched).unwrap();
    latched.publish(&header("first")).unwrap();
    latched.publish(&header("second")).unwrap();
    let listener = node::<NoParams>("listener", domain).await;
    let mut mesh = listener.subscribe::<Header>("mesh", QosProfile::LatchedSub).unwrap();
    let mut last = mesh.next_within(SOON).await.unwrap();
    if last.frame_id == "first" {
        last = mesh.next_within(SOON).await.unwrap();
    }
    assert_eq!(last.frame_id, "second");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wait_that_ends_in_nothing_names_the_topic() {
    let node = node::<NoParams>("listener", free_domain()).await;
    let mut nothing = node.subscribe::<Header>("nothing", QosProfile::Standard).unwrap();
    let error = nothing.next_within(Duration::from_millis(50)).await.unwrap_err().to_string();
    assert!(error.contains("nothing on /nothing within 0.1 s (0 publishers matched)"), "{error}");
    node.stop().stop();
    assert!(nothing.next().await.is_none());
}

#[tokio::test(flavor = "multi_thread")]
async fn log_lines_come_out_on_rosout_and_health_on_diagnostics() {
    let domain = free_domain();
    let listener = node::<NoParams>("listener", domain).await;
    let mut lines = listener.subscribe::<Log>("/rosout", QosProfile::Standard).unwrap();
    let mut health =
        listener.subscribe::<DiagnosticArray>("/diagnostics", QosProfile::Standard).unwrap();
    let talker = node::<NoParams>("weather_station", domain).await;
    talker.diagnostics().set("scans", 3);
    tracing::warn!(node = "weather_station", "the sky is {}", "falling");
    // No other test of this program has a node of this name: lines go to nodes by their names.
    let line = loop {
        let line = lines.next_within(SOON).await.unwrap();
        if line.name == "weather_station" {
            break line;
        }
    };
    assert_eq!((line.msg.as_str(), line.level), ("the sky is falling", Log::WARN));
    assert!(line.file.ends_with("topics.rs") && line.line > 0);
    let status = loop {
        let message = health.next_within(SOON).await.unwrap();
        if let Some(status) = message.status.into_iter().find(|s| s.name == "/weather_station") {
            break status;
        }
    };
    assert_eq!(status.values[0].value, "3");
}

#[tokio::test(flavor = "multi_thread")]
async fn simulated_time_follows_the_clock() {
    let domain = free_domain();
    let driver = node::<NoParams>("driver", domain).await;
    let args = RosArgs::default().with_domain(domain).with_param("use_sim_time", true);
    let follower = node_with::<NoParams>("follower", args).await;
    assert_eq!(follower.now(), Stamp::ZERO);
    let late = follower.wait_for_clock(Duration::from_millis(50)).await.unwrap_err();
    assert!(format!("{late:#}").contains("/clock has not reached"), "{late:#}");
    let clock = driver.publisher::<Clock>("/clock", QosProfile::Standard).unwrap();
    clock.wait_for_readers(1, SOON).await.unwrap();
    let time = Stamp::from_seconds(12.5);
    let waiting = follower.wait_until(time, SOON);
    let ticking = async {
        loop {
            clock.publish(&Clock { clock: time.into() }).unwrap();
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    tokio::select! {
        waited = waiting => waited.unwrap(),
        () = ticking => {}
    }
    assert_eq!(follower.now(), time);
    assert!(driver.now() > time);
}

fn transform(parent: &str, child: &str, second: f64, x: f64) -> Transform {
    Transform {
        parent: parent.to_owned(),
        child: child.to_owned(),
        stamp: Stamp::from_seconds(second),
        pose: Pose::translation(x, 0.0, 0.0),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn transforms_travel_and_late_joiners_get_the_static_ones() {
    let domain = free_domain();
    let robot = node::<NoParams>("robot", domain).await;
    let broadcaster = robot.tf_broadcaster().unwrap();
    broadcaster.send_static(&[transform("arm", "sensor", 0.0, 0.25)]).unwrap();
    broadcaster.send_static(&[transform("world", "table", 0.0, 1.0)]).unwrap();
    let listener = node::<NoParams>("listener", domain).await;
    let tf = listener.tf().unwrap();
    let known = tf.wait("arm", "sensor", Stamp::from_seconds(5.0), SOON).await.unwrap();
    assert_eq!(known.translation.x, 0.25);
    let at = Stamp::from_seconds(1.5);
    let ticking = async {
        loop {
            broadcaster.send(&[transform("world", "arm", 1.0, 1.0)]).unwrap();
            broadcaster.send(&[transform("world", "arm", 2.0, 2.0)]).unwrap();
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    let pose = tokio::select! {
        pose = tf.wait("table", "sensor", at, SOON) => pose.unwrap(),
        () = ticking => unreachable!(),
    };
    assert!((pose.translation.x - 0.75).abs() < 1e-12);
    assert_eq!(robot.tf().unwrap().lookup("table", "sensor", at).unwrap(), pose);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_dropped_node_leaves_the_others_within_the_deadline() {
    let domain = free_domain();
    let listener = node::<NoParams>("listener", domain).await;
    let heard = listener.subscribe::<Header>("out", QosProfile::Standard).unwrap();
    let talker = node::<NoParams>("talker", domain).await;
    let publisher = talker.publisher::<Header>("out", QosProfile::Standard).unwrap();
    heard.wait_for_writer(SOON).await.unwrap();
    drop((talker, publisher));
    eventually("the publisher is gone", || heard.writers() == 0).await;
}
