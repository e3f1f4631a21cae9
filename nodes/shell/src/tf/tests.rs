use super::*;
use nalgebra::{Translation3, UnitQuaternion, Vector3};

fn pose(x: f64, yaw: f64) -> Pose {
    Pose::from_parts(
        Translation3::new(x, 0.0, 0.0),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw),
    )
}

fn insert(buffer: &TfBuffer, parent: &str, child: &str, at: f64, pose: Pose, is_static: bool) {
    let stamp = Stamp::from_seconds(at);
    let (parent, child) = (parent.to_owned(), child.to_owned());
    buffer.insert(Transform { parent, child, stamp, pose }, is_static);
}

/// world -> arm (moving) -> sensor (static), world -> table (static), and an island.
fn buffer() -> TfBuffer {
    let buffer = TfBuffer::new(Duration::from_secs(10));
    insert(&buffer, "world", "arm", 1.0, pose(0.0, 0.0), false);
    insert(&buffer, "world", "arm", 2.0, pose(2.0, 1.0), false);
    insert(&buffer, "arm", "sensor", 0.0, pose(0.5, 0.0), true);
    insert(&buffer, "world", "table", 0.0, pose(-1.0, 0.0), true);
    insert(&buffer, "moon", "crater", 1.0, pose(1.0, 0.0), false);
    buffer
}

#[test]
fn between_two_samples_is_interpolated_and_a_sample_is_exact() {
    let buffer = buffer();
    let half = buffer.lookup("world", "arm", Stamp::from_seconds(1.5)).unwrap();
    assert!((half.translation.x - 1.0).abs() < 1e-12);
    assert!((half.rotation.angle() - 0.5).abs() < 1e-12);
    let exact = buffer.lookup("world", "arm", Stamp::from_seconds(2.0)).unwrap();
    assert_eq!(exact, pose(2.0, 1.0));
}

#[test]
fn the_tree_is_walked_up_and_down() {
    let buffer = buffer();
    let at = Stamp::from_seconds(2.0);
    let table_from_sensor = buffer.lookup("table", "sensor", at).unwrap();
    let expected = pose(-1.0, 0.0).inverse() * pose(2.0, 1.0) * pose(0.5, 0.0);
    assert!((table_from_sensor.to_homogeneous() - expected.to_homogeneous()).norm() < 1e-12);
    let back = buffer.lookup("sensor", "table", at).unwrap() * table_from_sensor;
    assert!((back.to_homogeneous() - Pose::identity().to_homogeneous()).norm() < 1e-12);
    assert_eq!(buffer.lookup("arm", "arm", at).unwrap(), Pose::identity());
    assert_eq!(buffer.lookup("/arm", "sensor", at).unwrap(), pose(0.5, 0.0));
    let (latest, stamp) = buffer.latest("table", "sensor").unwrap();
    assert_eq!((latest, stamp), (table_from_sensor, at));
    assert_eq!(buffer.latest("arm", "sensor").unwrap().1, Stamp::ZERO);
}

#[test]
fn what_is_not_known_is_said() {
    let buffer = buffer();
    let says = |target, source, at, text: &str| {
        let error = buffer.lookup(target, source, Stamp::from_seconds(at)).unwrap_err().to_string();
        assert!(error.contains(text), "{error}");
    };
    says(
        "world",
        "hand",
        1.0,
        "frame `hand` is unknown; known are arm, crater, moon, sensor, table, world",
    );
    says("world", "crater", 1.0, "not connected: their roots are `world` and `moon`");
    says("world", "arm", 0.5, "world <- arm at 0.500000000: 0.500 s before the oldest");
    says("table", "sensor", 2.25, "0.250 s after the newest; there are 2 transforms from 1.0");
    insert(&buffer, "sensor", "world", 1.0, pose(0.0, 0.0), true);
    says("world", "arm", 1.0, "hangs on itself");
}

#[test]
fn the_past_beyond_the_window_is_forgotten() {
    let buffer = TfBuffer::new(Duration::from_secs(1));
    for step in 0..30 {
        insert(&buffer, "world", "arm", f64::from(step) * 0.1, pose(f64::from(step), 0.0), false);
    }
    assert!(buffer.lookup("world", "arm", Stamp::from_seconds(1.9)).is_ok());
    let error = buffer.lookup("world", "arm", Stamp::from_seconds(1.8)).unwrap_err();
    assert!(error.to_string().contains("there are 11 transforms"), "{error}");
}

#[test]
fn a_frame_that_is_hung_elsewhere_forgets_its_past() {
    let buffer = buffer();
    insert(&buffer, "table", "arm", 3.0, pose(9.0, 0.0), false);
    assert_eq!(buffer.lookup("table", "arm", Stamp::from_seconds(3.0)).unwrap(), pose(9.0, 0.0));
    assert!(buffer.lookup("table", "arm", Stamp::from_seconds(2.0)).is_err());
}

#[tokio::test]
async fn waiting_ends_with_the_transform_or_with_the_reason() {
    let buffer = buffer();
    let at = Stamp::from_seconds(2.5);
    let waiting = tokio::spawn({
        let buffer = buffer.clone();
        async move { buffer.wait("world", "sensor", at, Duration::from_secs(30)).await }
    });
    tokio::task::yield_now().await;
    insert(&buffer, "world", "arm", 3.0, pose(4.0, 1.0), false);
    assert!(waiting.await.unwrap().is_ok());
    let late = buffer
        .wait("world", "arm", Stamp::from_seconds(9.0), Duration::from_millis(20))
        .await
        .unwrap_err();
    assert!(late.to_string().contains("no transform world <- arm within 0.0 s"), "{late}");
    assert!(late.to_string().contains("6.000 s after the newest"), "{late}");
    let gone = buffer.wait("world", "arm", Stamp::ZERO, Duration::from_secs(3600)).await;
    assert!(matches!(gone, Err(TfError::OutOfRange { .. })));
}

#[test]
fn numbers_pass_through_a_message_unchanged_and_bad_ones_are_refused() {
    let mut ros = puffer_msgs::geometry_msgs::msg::TransformStamped::default();
    ros.header.frame_id = "world".to_owned();
    ros.child_frame_id = "arm".to_owned();
    ros.transform.translation.x = 0.1;
    ros.transform.rotation.w = 1.0;
    assert_eq!(from_ros(&ros).unwrap().pose.translation.x, 0.1);
    ros.transform.rotation.w = 0.0;
    assert!(from_ros(&ros).unwrap_err().contains("length 0.0000"));
    ros.transform.rotation.w = 1.0;
    ros.child_frame_id = "world".to_owned();
    assert!(from_ros(&ros).unwrap_err().contains("two different frames"));
}
