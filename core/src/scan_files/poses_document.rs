//! Reading and checking of `poses.json`, the list of views with their poses.

use super::view_ply::Frame;
use crate::geometry::{Pose, pose_from_rows, pose_to_rows};
use crate::mesh::io::Unit;
use crate::params::ParamValue;
use crate::scan::{PoseSigma, SensorKind, Support};
use crate::{Error, Result};
use nalgebra::{Quaternion, UnitQuaternion};
use serde_json::{Value, json};
use std::collections::HashSet;
use std::path::Path;

/// The only value of the key `format` that is understood.
pub(super) const FORMAT: &str = "puffer-scans-1";
/// Value of the key `cloud_frame` where the clouds are Stanford's range grids.
pub(super) const RANGE_GRID: &str = "range_grid";
/// Key of a view's rotation as x y z w, beside the matrix: it brings the pose back bit by bit,
/// which a matrix does not.
pub(super) const QUATERNION: &str = "quaternion";
/// Largest difference, radians, between a quaternion and the matrix beside it that rounding
/// explains.
const MAX_ROUNDING_RAD: f64 = 1e-9;
/// Farthest that a sensor is believed to be from the object frame, metres: poses in millimetres lie
/// beyond.
const MAX_SENSOR_DISTANCE_M: f64 = 100.0;

/// One view of a document.
pub(super) struct PosesEntry {
    pub(super) name: String,
    /// Path of the cloud as written in the document.
    pub(super) cloud: String,
    /// Points in a row if the document states it, else 0.
    pub(super) width: usize,
    pub(super) object_from_sensor: Pose,
}

/// The checked contents of a document.
pub(super) struct PosesDocument {
    pub(super) entries: Vec<PosesEntry>,
    pub(super) frame: Frame,
    pub(super) sensor: Option<SensorKind>,
    pub(super) pose_sigma: Option<PoseSigma>,
    pub(super) support: Support,
    pub(super) nominal: Value,
    /// Folder of the clouds, from that of the document; empty for the same.
    pub(super) clouds_in: String,
}

/// Reads a document's text as JSON.
pub(super) fn parse_json(bytes: &[u8], path: &Path) -> Result<Value> {
    serde_json::from_slice(bytes)
        .map_err(|e| Error::format(path, format!("is not JSON: {e}; it must be an object")))
}

/// Checks a document; `path` is where it came from.
pub(super) fn parse(document: &Value, path: &Path, unit: Unit) -> Result<PosesDocument> {
    parse_document(document, unit).map_err(|message| Error::format(path, message))
}

/// As [`parse`]; the error says what is wrong with the document.
fn parse_document(document: &Value, unit: Unit) -> std::result::Result<PosesDocument, String> {
    match &document["format"] {
        Value::String(format) if format == FORMAT => {}
        Value::Null => {
            return Err(format!("lacks the key \"format\"; it must say \"{FORMAT}\""));
        }
        other => return Err(format!("has the format {other}; only \"{FORMAT}\" is read")),
    }
    let views = document["views"].as_array().map_or(&[][..], Vec::as_slice);
    if views.is_empty() {
        return Err("has no views: \"views\" must list a cloud and a pose each".into());
    }
    let mut names = HashSet::new();
    let mut entries = Vec::with_capacity(views.len());
    for (index, view) in views.iter().enumerate() {
        let entry = parse_entry(view, unit).map_err(|e| format!("view {index}{e}"))?;
        if !names.insert(entry.name.clone()) {
            return Err(format!(
                "view {index} ({}): an earlier view has this name already; give each its own",
                entry.cloud
            ));
        }
        entries.push(entry);
    }
    Ok(PosesDocument {
        entries,
        frame: parse_frame(document)?,
        sensor: parse_sensor(document)?,
        pose_sigma: parse_pose_sigma(document, unit)?,
        support: parse_support(document)?,
        nominal: document["nominal"].clone(),
        clouds_in: document["clouds_in"].as_str().unwrap_or_default().to_owned(),
    })
}

/// The error is the rest of a sentence that starts with the view's number.
fn parse_entry(view: &Value, unit: Unit) -> std::result::Result<PosesEntry, String> {
    let cloud = view["cloud"]
        .as_str()
        .filter(|cloud| !cloud.is_empty())
        .ok_or_else(|| String::from(": lacks \"cloud\", the name of its PLY file"))?;
    let object_from_sensor = parse_pose(&view["object_from_sensor"], unit)
        .map_err(|message| format!(" ({cloud}): {message}"))?;
    let object_from_sensor = with_exact_rotation(object_from_sensor, &view[QUATERNION]);
    let width = view["width"].as_u64().and_then(|w| usize::try_from(w).ok()).unwrap_or(0);
    let name = view_name(cloud);
    Ok(PosesEntry { name, cloud: cloud.to_owned(), width, object_from_sensor })
}

/// A cloud's path without the extension.
pub(super) fn view_name(cloud: &str) -> String {
    Path::new(cloud).with_extension("").to_string_lossy().into_owned()
}

fn parse_pose(value: &Value, unit: Unit) -> std::result::Result<Pose, String> {
    if value.is_null() {
        return Err("lacks \"object_from_sensor\", its pose as a 4 x 4 matrix".into());
    }
    let rows: [[f64; 4]; 4] = serde_json::from_value(value.clone()).map_err(|_| {
        "\"object_from_sensor\" must be four rows of four numbers (row-major)".to_owned()
    })?;
    let mut pose = pose_from_rows(&rows).map_err(|e| format!("\"object_from_sensor\": {e}"))?;
    pose.translation.vector *= unit.metres_per_unit();
    let distance = pose.translation.vector.norm();
    if distance > MAX_SENSOR_DISTANCE_M {
        return Err(format!(
            "its pose lies {distance:.1} m from the object's frame: millimetres? use --unit mm"
        ));
    }
    Ok(pose)
}

/// The pose with the rotation `quaternion` if that is the same one; a matrix that somebody changed
/// counts.
fn with_exact_rotation(pose: Pose, quaternion: &Value) -> Pose {
    let Ok([x, y, z, w]) = serde_json::from_value::<[f64; 4]>(quaternion.clone()) else {
        return pose;
    };
    let quaternion = Quaternion::new(w, x, y, z);
    let rotation = UnitQuaternion::new_unchecked(quaternion);
    let is_unit = (quaternion.norm() - 1.0).abs() < MAX_ROUNDING_RAD;
    if is_unit && pose.rotation.angle_to(&rotation) < MAX_ROUNDING_RAD {
        Pose::from_parts(pose.translation, rotation)
    } else {
        pose
    }
}

fn parse_frame(document: &Value) -> std::result::Result<Frame, String> {
    match &document["cloud_frame"] {
        Value::Null => Ok(Frame::Sensor),
        Value::String(word) if word == "sensor" => Ok(Frame::Sensor),
        Value::String(word) if word == RANGE_GRID => Ok(Frame::RangeGrid),
        other => {
            Err(format!("has the cloud_frame {other}; known are \"sensor\" and \"{RANGE_GRID}\""))
        }
    }
}

fn parse_sensor(document: &Value) -> std::result::Result<Option<SensorKind>, String> {
    let value = &document["sensor"];
    if value.is_null() {
        return Ok(None);
    }
    let kind = value.as_str().and_then(SensorKind::from_word);
    kind.map(Some).ok_or_else(|| {
        format!("has the sensor {value}; known are \"laser\" and \"stereo\"; leave it out if neither fits")
    })
}

fn parse_support(document: &Value) -> std::result::Result<Support, String> {
    let value = &document["support"];
    if value.is_null() {
        return Ok(Support::None);
    }
    Support::from_value(value).ok_or_else(|| {
        format!("has the support {value}; known are \"none\" and \"table\" (the plane z = 0)")
    })
}

fn parse_pose_sigma(
    document: &Value,
    unit: Unit,
) -> std::result::Result<Option<PoseSigma>, String> {
    let value = &document["pose_sigma"];
    if value.is_null() {
        return Ok(None);
    }
    let translation = parse_deviation(value, "translation")? * unit.metres_per_unit();
    Ok(Some(PoseSigma { translation, rotation: parse_deviation(value, "rotation")? }))
}

fn parse_deviation(pose_sigma: &Value, key: &str) -> std::result::Result<f64, String> {
    pose_sigma[key].as_f64().filter(|v| v.is_finite() && *v >= 0.0).ok_or_else(|| {
        format!("\"pose_sigma\" must have \"{key}\", a number not below 0 (metres, radians)")
    })
}

/// A pose as the keys of a view, in a document whose lengths are in `unit`.
pub(super) fn pose_keys(pose: &Pose, unit: Unit) -> Value {
    let q = pose.rotation.quaternion();
    json!({"object_from_sensor": pose_to_matrix(pose, unit), QUATERNION: [q.i, q.j, q.k, q.w]})
}

/// A pose as a matrix in a document whose lengths are in `unit`.
pub(super) fn pose_to_matrix(pose: &Pose, unit: Unit) -> Value {
    let mut rows = pose_to_rows(pose);
    for row in rows.iter_mut().take(3) {
        row[3] /= unit.metres_per_unit();
    }
    json!(rows)
}
