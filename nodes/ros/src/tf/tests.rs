use super::*;
use crate::Stamp;
use puffer_core::geometry::{Pose, Twist, exp, log};
use puffer_msgs::tf2_msgs::msg::TFMessage;
use std::time::Duration;

fn pose(seed: f64) -> Pose {
    exp(&Twist::new(0.3 * seed, -0.2, 0.5 + seed, 0.4, -0.3 * seed, 0.2))
}

fn transform(parent: &str, child: &str, millis: i64, pose: Pose) -> Transform {
    let stamp = at(millis);
    Transform { parent: parent.into(), child: child.into(), stamp, pose }
}

fn at(millis: i64) -> Stamp {
    Stamp::from_nanos(millis * 1_000_000)
}

fn close(a: &Pose, b: &Pose) -> bool {
    log(&(a.inverse() * b)).norm() < 1e-12
}

/// world <- base (static), base <- arm (moving), world <- object (static).
fn arm() -> TfBuffer {
    let buffer = TfBuffer::default();
    buffer.insert(transform("world", "base", 0, pose(0.1)), true);
    buffer.insert(transform("world", "object", 0, pose(0.2)), true);
    for i in 0..=10 {
        buffer.insert(transform("base", "arm", 1000 + 100 * i, pose(i as f64 * 0.3)), false);
    }
    buffer
}

#[test]
fn a_stamp_of_a_sample_gives_the_sample_itself() {
    let found = arm().lookup("base", "arm", at(1300)).unwrap();
    assert_eq!(bits(&found), bits(&pose(3.0 * 0.3)));
}

fn bits(pose: &Pose) -> Vec<u64> {
    let numbers = pose.translation.vector.iter().chain(pose.rotation.coords.iter());
    numbers.map(|v| v.to_bits()).collect()
}

#[test]
fn transforms_compose_through_the_common_ancestor_in_both_directions() {
    let buffer = arm();
    let expected = pose(0.2).inverse() * pose(0.1) * pose(0.6);
    assert!(close(&buffer.lookup("object", "arm", at(1200)).unwrap(), &expected));
    assert!(close(&buffer.lookup("arm", "object", at(1200)).unwrap(), &expected.inverse()));
    assert!(close(&buffer.lookup("/object", "/arm", at(1200)).unwrap(), &expected));
    assert_eq!(buffer.lookup("arm", "arm", at(1200)).unwrap(), Pose::identity());
}

#[test]
fn between_two_samples_the_motion_is_even() {
    let buffer = TfBuffer::default();
    let (a, b) = (pose(0.0), pose(1.0));
    buffer.insert(transform("a", "b", 1000, a), false);
    buffer.insert(transform("a", "b", 2000, b), false);
    let middle = buffer.lookup("a", "b", at(1250)).unwrap();
    let position = a.translation.vector * 0.75 + b.translation.vector * 0.25;
    assert!((middle.translation.vector - position).norm() < 1e-12);
    let whole = a.rotation.angle_to(&b.rotation);
    assert!((a.rotation.angle_to(&middle.rotation) - 0.25 * whole).abs() < 1e-9);
    assert!((middle.rotation.angle_to(&b.rotation) - 0.75 * whole).abs() < 1e-9);
    // The same rotation with the other sign of its quaternion.
    let flipped = nalgebra::UnitQuaternion::new_unchecked(-b.rotation.into_inner());
    buffer.insert(transform("a", "b", 2000, Pose::from_parts(b.translation, flipped)), false);
    assert!(close(&buffer.lookup("a", "b", at(1250)).unwrap(), &middle));
}

#[test]
fn half_a_turn_and_no_turn_at_all_have_something_between_them() {
    let buffer = TfBuffer::default();
    let turned = exp(&Twist::new(0.0, 0.0, 0.0, std::f64::consts::PI, 0.0, 0.0));
    buffer.insert(transform("a", "b", 0, Pose::identity()), false);
    buffer.insert(transform("a", "b", 1000, turned), false);
    let found = buffer.lookup("a", "b", at(700)).unwrap();
    assert!((found.rotation.angle() - 0.7 * std::f64::consts::PI).abs() < 1e-9);
    buffer.insert(transform("a", "b", 2000, turned), false);
    assert!(close(&buffer.lookup("a", "b", at(1500)).unwrap(), &turned));
}

#[test]
fn a_stamp_outside_is_told_with_the_link_and_the_range() {
    let buffer = arm();
    let error = buffer.lookup("object", "arm", at(2250)).unwrap_err();
    let text = error.to_string();
    assert_eq!(
        text,
        "base <- arm at 2.250000000: 0.250 s after the newest; there are 11 transforms from \
         1.000000000 to 2.000000000"
    );
    let text = buffer.lookup("object", "arm", at(1)).unwrap_err().to_string();
    assert!(text.contains("0.999 s before the oldest"), "{text}");
    assert!(buffer.lookup("object", "base", at(9_000_000)).is_ok(), "static ones hold always");
}

#[test]
fn a_stale_link_above_the_common_ancestor_does_no_harm() {
    let buffer = arm();
    buffer.insert(transform("map", "world", 0, pose(0.5)), false);
    assert!(buffer.lookup("object", "arm", at(1200)).is_ok());
    assert!(matches!(buffer.lookup("map", "arm", at(1200)), Err(TfError::OutOfRange { .. })));
}

#[test]
fn unknown_and_unconnected_frames_are_told_apart() {
    let buffer = arm();
    buffer.insert(transform("island", "palm", 0, pose(0.0)), true);
    let text = buffer.lookup("world", "hand", at(1200)).unwrap_err().to_string();
    assert_eq!(text, "frame `hand` is unknown; known are arm, base, island, object, palm, world");
    let text = buffer.lookup("palm", "arm", at(1200)).unwrap_err().to_string();
    assert!(text.ends_with("their roots are `island` and `world`"), "{text}");
    let text = TfBuffer::default().lookup("a", "b", at(0)).unwrap_err().to_string();
    assert_eq!(text, "frame `a` is unknown; known are none yet");
}

#[test]
fn the_window_forgets_old_samples_and_a_restart_forgets_all() {
    let buffer = TfBuffer::new(Duration::from_secs(1));
    for i in 0..=30 {
        buffer.insert(transform("a", "b", 100 * i, pose(0.1 * i as f64)), false);
    }
    assert!(buffer.lookup("a", "b", at(2000)).is_ok());
    assert!(matches!(
        buffer.lookup("a", "b", at(1999)),
        Err(TfError::OutOfRange { count: 11, .. })
    ));
    // A late one within the window is sorted in; one far before it begins time anew.
    buffer.insert(transform("a", "b", 2050, pose(9.0)), false);
    assert_eq!(buffer.lookup("a", "b", at(2050)).unwrap(), pose(9.0));
    assert_eq!(buffer.latest("a", "b").unwrap().1, at(3000));
    buffer.insert(transform("a", "b", 10, pose(1.0)), false);
    assert_eq!(buffer.latest("a", "b").unwrap(), (pose(1.0), at(10)));
}

#[test]
fn a_frame_may_change_its_parent() {
    let buffer = TfBuffer::default();
    buffer.insert(transform("world", "gripper", 0, pose(0.3)), true);
    buffer.insert(transform("world", "table", 0, pose(0.4)), true);
    buffer.insert(transform("table", "part", 1000, pose(0.5)), false);
    buffer.insert(transform("gripper", "part", 2000, pose(0.6)), false);
    let on_table = buffer.lookup("world", "part", at(1000)).unwrap();
    assert!(close(&on_table, &(pose(0.4) * pose(0.5))));
    assert!(close(&buffer.lookup("world", "part", at(1999)).unwrap(), &on_table));
    let held = pose(0.3) * pose(0.6);
    assert!(close(&buffer.lookup("world", "part", at(2000)).unwrap(), &held));
    assert!(close(&buffer.latest("world", "part").unwrap().0, &held));
}

#[test]
fn a_circle_of_frames_ends() {
    let buffer = TfBuffer::default();
    for (parent, child) in [("a", "b"), ("b", "c"), ("c", "a"), ("x", "y"), ("z", "z")] {
        buffer.insert(transform(parent, child, 0, pose(0.3)), true);
    }
    assert!(buffer.lookup("a", "c", at(0)).is_ok());
    assert!(matches!(buffer.lookup("a", "y", at(0)), Err(TfError::NotConnected { .. })));
    assert!(matches!(buffer.lookup("z", "y", at(0)), Err(TfError::NotConnected { .. })));
}

#[test]
fn latest_is_the_stamp_that_all_links_have_reached() {
    let buffer = arm();
    for millis in [1500, 1850] {
        buffer.insert(transform("arm", "camera", millis, pose(0.7)), false);
    }
    let (found, stamp) = buffer.latest("object", "camera").unwrap();
    assert_eq!(stamp, at(1850));
    assert_eq!(found, buffer.lookup("object", "camera", stamp).unwrap());
    assert_eq!(buffer.latest("object", "base").unwrap().1, Stamp::ZERO);
}

/// Transforms of second 3 that shift by 2 along x, by parent, child and the w of their quaternions.
fn tf_message(transforms: &[(&str, &str, f64)]) -> TFMessage {
    let mut message = TFMessage::default();
    for (parent, child, w) in transforms {
        let mut transform = puffer_msgs::geometry_msgs::msg::TransformStamped::default();
        transform.header.frame_id = (*parent).into();
        transform.header.stamp.sec = 3;
        transform.child_frame_id = (*child).into();
        transform.transform.translation.x = 2.0;
        transform.transform.rotation.w = *w;
        message.transforms.push(transform);
    }
    message
}

#[test]
fn a_message_is_taken_except_for_what_is_no_transform() {
    let buffer = TfBuffer::default();
    buffer.insert_message(&tf_message(&[("/a", "b", 1.0), ("b", "c", 1.0)]), false).unwrap();
    assert_eq!(buffer.lookup("a", "c", at(3000)).unwrap().translation.x, 4.0);
    let mixed = [("a", "bad", 0.0), ("a", "a", 1.0), ("a", "", 1.0), ("a", "good", 1.0)];
    let text = buffer.insert_message(&tf_message(&mixed), true).unwrap_err();
    assert!(text.contains("transform a <- bad: the quaternion has length 0"), "{text}");
    assert!(text.contains("a <- a: a frame is its own parent"), "{text}");
    assert!(text.contains("a <- : a frame has no name"), "{text}");
    assert!(buffer.lookup("a", "good", at(99)).is_ok());
}

#[tokio::test]
async fn a_wait_ends_with_the_transform_or_the_deadline() {
    let buffer = TfBuffer::default();
    let writer = buffer.clone();
    let (done, _) =
        tokio::join!(buffer.wait("a", "b", at(1500), Duration::from_secs(20)), async move {
            for millis in [1000, 2000] {
                tokio::time::sleep(Duration::from_millis(5)).await;
                writer.insert(transform("a", "b", millis, pose(0.2)), false);
            }
        });
    assert!(close(&done.unwrap(), &pose(0.2)));
    let error = buffer.wait("a", "b", at(2500), Duration::from_millis(20)).await.unwrap_err();
    let text = error.to_string();
    assert!(text.starts_with("no transform a <- b within 0.0 s: a <- b at 2.5"), "{text}");
}
