//! Poses and vectors.

use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use puffer_core::geometry::{Mat6, Pose, Vec3};
use puffer_msgs::geometry_msgs::msg;

/// The message of a point.
pub fn point_message(v: &Vec3) -> msg::Point {
    msg::Point { x: v.x, y: v.y, z: v.z }
}

/// The message of a vector.
pub fn vector_message(v: &Vec3) -> msg::Vector3 {
    msg::Vector3 { x: v.x, y: v.y, z: v.z }
}

fn quaternion_message(rotation: &UnitQuaternion<f64>) -> msg::Quaternion {
    let q = rotation.quaternion();
    msg::Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }
}

/// The message of a pose.
pub fn pose_message(pose: &Pose) -> msg::Pose {
    msg::Pose {
        position: point_message(&pose.translation.vector),
        orientation: quaternion_message(&pose.rotation),
    }
}

/// The message of a pose with its covariance, whose 36 numbers stand row by row in the order x, y,
/// z, rotation about x, y, z.
pub fn pose_with_covariance(pose: &Pose, covariance: &Mat6) -> msg::PoseWithCovariance {
    let mut numbers = [0.0; 36];
    for (i, number) in numbers.iter_mut().enumerate() {
        *number = covariance[(i / 6, i % 6)];
    }
    msg::PoseWithCovariance { pose: pose_message(pose), covariance: numbers }
}

/// The transform message of a pose.
pub fn transform_message(pose: &Pose) -> msg::Transform {
    msg::Transform {
        translation: vector_message(&pose.translation.vector),
        rotation: quaternion_message(&pose.rotation),
    }
}

/// The pose of a message. A quaternion whose length is 1 (to a millionth) is taken bit by bit, so
/// that a pose passes through messages unchanged.
///
/// # Errors
/// In words, if a number is not finite or the length of the quaternion is far from 1.
pub fn pose_from_message(pose: &msg::Pose) -> Result<Pose, String> {
    let msg::Point { x, y, z } = pose.position;
    checked_pose(Vec3::new(x, y, z), &pose.orientation)
}

/// The pose of a transform message; see [`pose_from_message`].
///
/// # Errors
/// Those of [`pose_from_message`].
pub fn pose_from_transform(transform: &msg::Transform) -> Result<Pose, String> {
    let msg::Vector3 { x, y, z } = transform.translation;
    checked_pose(Vec3::new(x, y, z), &transform.rotation)
}

/// A quaternion whose length differs from 1 by more is an error.
const MAX_QUATERNION_LENGTH_ERROR: f64 = 1e-2;
/// A quaternion whose length differs from 1 by less is taken unchanged.
const MAX_ROUNDING_LENGTH_ERROR: f64 = 1e-6;

fn checked_pose(position: Vec3, q: &msg::Quaternion) -> Result<Pose, String> {
    let quaternion = Quaternion::new(q.w, q.x, q.y, q.z);
    let norm = quaternion.norm();
    if !position.iter().all(|v| v.is_finite()) || !norm.is_finite() {
        return Err(format!("the pose holds a number that is not finite: {position:?}, {q:?}"));
    }
    if (norm - 1.0).abs() > MAX_QUATERNION_LENGTH_ERROR {
        return Err(format!("the quaternion has length {norm}, not 1: {q:?}"));
    }
    let rotation = if (norm - 1.0).abs() < MAX_ROUNDING_LENGTH_ERROR {
        UnitQuaternion::new_unchecked(quaternion)
    } else {
        UnitQuaternion::new_normalize(quaternion)
    };
    Ok(Pose::from_parts(Translation3::from(position), rotation))
}
