//! Writing of scan folders and of corrected poses.

use super::poses_document::{FORMAT, pose_keys};
use super::scan_set::{ScanSet, View};
use super::scan_source::{ScanSource, read_document};
use super::view_ply;
use crate::geometry::{Pose, Scan};
use crate::mesh::io::{Unit, write_bytes};
use crate::params::ParamValue;
use crate::scan::{PoseSigma, SensorKind, Support};
use crate::{Error, Result};
use serde_json::{Map, Value, json};
use std::path::{Component, Path, PathBuf};

/// Writes a scan folder in metres, which is created if need be: one binary PLY a view, then
/// `poses.json`. `extras[i]`, an object, is added to view `i` (a verdict, for instance); `extras`
/// may be empty.
///
/// # Errors
/// [`Error::Input`] if `extras` has another length than the views, two views would share a file, or
/// a scan's vectors do not fit each other, [`Error::Io`] if something cannot be written.
pub fn write_scans(dir: &Path, set: &ScanSet, extras: &[Value]) -> Result<()> {
    check_extras(extras, set.views.len())?;
    let head = ScanSet { views: Vec::new(), nominal: set.nominal.clone(), ..*set };
    let mut folder = ScanFolder::create(dir, head)?;
    for (i, view) in set.views.iter().enumerate() {
        let file = file_name(&view.name);
        if folder.entries.iter().any(|(other, _)| *other == file) {
            return Err(Error::input(format!("two views would be written to {file}: rename one")));
        }
        folder.write_view(view, extras.get(i).cloned().unwrap_or_default())?;
    }
    folder.save()
}

/// A scan folder that grows while scans are taken.
pub struct ScanFolder {
    dir: PathBuf,
    /// Without views.
    set: ScanSet,
    /// File and pose of each view.
    entries: Vec<(String, Pose)>,
    extras: Vec<Value>,
}

impl ScanFolder {
    /// Creates the folder; `set`, whose own views are ignored, holds what is known of all scans.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be created.
    pub fn create(dir: &Path, set: ScanSet) -> Result<ScanFolder> {
        std::fs::create_dir_all(dir).map_err(|e| Error::io("create", dir, e))?;
        Ok(ScanFolder { dir: dir.to_path_buf(), set, entries: Vec::new(), extras: Vec::new() })
    }

    /// Writes the points of a view, in place of an earlier one of the same name. `extra`, an object
    /// or null, joins it in `poses.json`, which [`ScanFolder::save`] writes.
    ///
    /// # Errors
    /// [`Error::Input`] if the scan's vectors do not fit each other; [`Error::Io`].
    pub fn write_view(&mut self, view: &View, extra: Value) -> Result<()> {
        check_scan(view)?;
        let file = file_name(&view.name);
        write_bytes(&self.dir.join(&file), &view_ply::encode_scan(&view.scan))?;
        match self.entries.iter().position(|(other, _)| *other == file) {
            Some(place) => {
                self.entries[place].1 = view.object_from_sensor;
                self.extras[place] = extra;
            }
            None => {
                self.entries.push((file, view.object_from_sensor));
                self.extras.push(extra);
            }
        }
        Ok(())
    }

    /// Writes `poses.json` with all views so far.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn save(&self) -> Result<()> {
        let ScanSet { sensor, pose_sigma, support, ref nominal, .. } = self.set;
        let head = DocumentHeader { sensor, pose_sigma, support, nominal };
        let document = new_document(&head, &self.entries, &self.extras);
        write_json(&self.dir.join("poses.json"), &document)
    }
}

/// The keys of a document that belong to all views.
struct DocumentHeader<'a> {
    sensor: Option<SensorKind>,
    pose_sigma: Option<PoseSigma>,
    support: Support,
    nominal: &'a Value,
}

/// A document of the views `entries`, each a file and a pose.
fn new_document(head: &DocumentHeader, entries: &[(String, Pose)], extras: &[Value]) -> Value {
    let mut document = Map::new();
    document.insert("format".into(), FORMAT.into());
    if let Some(sensor) = head.sensor {
        document.insert("sensor".into(), sensor.word().into());
    }
    if !head.nominal.is_null() {
        document.insert("nominal".into(), head.nominal.clone());
    }
    if let Some(sigma) = head.pose_sigma {
        let value = json!({"translation": sigma.translation, "rotation": sigma.rotation});
        document.insert("pose_sigma".into(), value);
    }
    if head.support != Support::None {
        document.insert("support".into(), head.support.to_value());
    }
    let mut views: Vec<Value> = entries.iter().map(|(file, pose)| new_view(file, pose)).collect();
    for (view, extra) in views.iter_mut().zip(extras) {
        merge_keys(view, extra);
    }
    document.insert("views".into(), views.into());
    document.into()
}

/// A view of a document in metres.
fn new_view(file: &str, pose: &Pose) -> Value {
    let mut view = json!({"cloud": file});
    merge_keys(&mut view, &pose_keys(pose, Unit::Metre));
    view
}

/// Writes the poses file of the scans `source` anew to `path`, with `poses` in place of its own and
/// `extras[i]`, an object, added to view `i`; `extras` may be empty. All other keys of the file are
/// kept, and its unit.
///
/// In another folder than the source's, the key `clouds_in` names the folder of the clouds. Scans
/// that never were in files get the names that [`write_scans`] would give them.
///
/// # Errors
/// As [`ScanSource::open`]; [`Error::Input`] if the counts differ; [`Error::Io`] if it cannot be
/// written.
pub fn write_poses(
    path: &Path,
    source: &ScanSource,
    poses: &[Pose],
    extras: &[Value],
) -> Result<()> {
    if source.len() != poses.len() {
        return Err(Error::input(format!(
            "the scans have {} views, but {} poses are to be written",
            source.len(),
            poses.len()
        )));
    }
    check_extras(extras, poses.len())?;
    let Some((file, unit)) = source.file() else {
        let entries: Vec<(String, Pose)> =
            (0..poses.len()).map(|i| (file_name(source.name(i)), poses[i])).collect();
        let head = DocumentHeader {
            sensor: source.sensor,
            pose_sigma: source.pose_sigma,
            support: source.support,
            nominal: &source.nominal,
        };
        return write_json(path, &new_document(&head, &entries, extras));
    };
    let (mut document, file) = read_document(file)?;
    let views = document.get_mut("views").and_then(Value::as_array_mut);
    let views = views.map_or(&mut [][..], Vec::as_mut_slice);
    for (view, pose) in views.iter_mut().zip(poses) {
        merge_keys(view, &pose_keys(pose, unit));
    }
    for (view, extra) in views.iter_mut().zip(extras) {
        merge_keys(view, extra);
    }
    let clouds = file.with_file_name("").join(document["clouds_in"].as_str().unwrap_or_default());
    if let Some(object) = document.as_object_mut() {
        object.remove("clouds_in");
        if let Some(folder) = relative_path(&path.with_file_name(""), &clouds) {
            object.insert("clouds_in".into(), folder.to_string_lossy().into());
        }
    }
    write_json(path, &document)
}

fn check_scan(view: &View) -> Result<()> {
    let Scan { points, width, origins } = &view.scan;
    let rows_are_full = *width == 0 || points.len().is_multiple_of(*width);
    if rows_are_full && (origins.is_empty() || origins.len() == points.len()) {
        return Ok(());
    }
    Err(Error::input(format!(
        "view {}: {} points do not fit {} origins and rows of {width}",
        view.name,
        points.len(),
        origins.len()
    )))
}

fn check_extras(extras: &[Value], views: usize) -> Result<()> {
    if extras.is_empty() || extras.len() == views {
        return Ok(());
    }
    Err(Error::input(format!("{} extras do not fit {views} views", extras.len())))
}

/// Puts the keys of the object `extra` into the object `view`.
fn merge_keys(view: &mut Value, extra: &Value) {
    if let (Some(view), Some(extra)) = (view.as_object_mut(), extra.as_object()) {
        view.extend(extra.iter().map(|(key, value)| (key.clone(), value.clone())));
    }
}

fn write_json(path: &Path, document: &Value) -> Result<()> {
    // Indented, because people read this file.
    write_bytes(path, format!("{document:#}\n").as_bytes())
}

/// A file's name made of a view's, without what a path or a file system could take amiss.
fn file_name(view: &str) -> String {
    let name: String = view
        .chars()
        .map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' })
        .collect();
    format!("{}.ply", if name.is_empty() { "view" } else { &name })
}

/// The relative path that leads from one folder to another; `None` if they are the same.
fn relative_path(from: &Path, to: &Path) -> Option<PathBuf> {
    let (from, to) = (or_current_folder(from), or_current_folder(to));
    let (Ok(from), Ok(to)) = (from.canonicalize(), to.canonicalize()) else { return Some(to) };
    let (from, to): (Vec<_>, Vec<_>) = (from.components().collect(), to.components().collect());
    let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let up = from[shared..].iter().map(|_| Component::ParentDir);
    let relative: PathBuf = up.chain(to[shared..].iter().copied()).collect();
    (!relative.as_os_str().is_empty()).then_some(relative)
}

/// The folder itself, or "." in place of an empty path.
fn or_current_folder(path: &Path) -> PathBuf {
    if path.as_os_str().is_empty() { ".".into() } else { path.to_path_buf() }
}
