//! Stanford's `*.conf`: the range images of an object with their poses.
//!
//! `bmesh FILE tx ty tz qx qy qz qw` means `p_object = R(q)^T p_file + t` (checked on the bunny's
//! ten scans); the files look along -z with y up.

use super::poses_document::{FORMAT, RANGE_GRID, pose_to_matrix};
use crate::geometry::{Pose, Vec3};
use crate::mesh::io::Unit;
use crate::scan::SensorKind;
use crate::{Error, Result};
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use serde_json::{Value, json};
use std::path::Path;

/// The `poses.json` that says the same.
pub(super) fn to_document(bytes: &[u8], path: &Path) -> Result<Value> {
    let text = String::from_utf8_lossy(bytes);
    let mut views = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let words: Vec<&str> = line.split_whitespace().collect();
        if let ["bmesh" | "mesh", rest @ ..] = words.as_slice() {
            let (cloud, object_from_sensor) = view(rest).ok_or_else(|| {
                let message = format!(
                    "line {}: must be 'bmesh FILE tx ty tz qx qy qz qw' with a unit quaternion",
                    number + 1
                );
                Error::format(path, message)
            })?;
            let matrix = pose_to_matrix(&object_from_sensor, Unit::Metre);
            views.push(json!({"cloud": cloud, "object_from_sensor": matrix}));
        }
    }
    if views.is_empty() {
        return Err(Error::format(path, "has no line 'bmesh FILE tx ty tz qx qy qz qw': no views"));
    }
    let sensor = SensorKind::Laser.word();
    Ok(json!({"format": FORMAT, "sensor": sensor, "cloud_frame": RANGE_GRID, "views": views}))
}

fn view<'a>(words: &[&'a str]) -> Option<(&'a str, Pose)> {
    let [cloud, numbers @ ..] = words else { return None };
    let numbers: Vec<f64> = numbers.iter().map(|w| w.parse().ok()).collect::<Option<_>>()?;
    let [tx, ty, tz, qx, qy, qz, qw] = numbers.as_slice() else { return None };
    let quaternion = Quaternion::new(*qw, *qx, *qy, *qz);
    // The text holds six digits.
    if !(quaternion.norm() - 1.0).abs().le(&1e-3) || ![tx, ty, tz].iter().all(|v| v.is_finite()) {
        return None;
    }
    let rotation = UnitQuaternion::from_quaternion(quaternion).inverse();
    let object_from_file = Pose::from_parts(Translation3::new(*tx, *ty, *tz), rotation);
    let half_turn = UnitQuaternion::from_axis_angle(&Vec3::x_axis(), std::f64::consts::PI);
    Some((cloud, object_from_file * half_turn))
}
