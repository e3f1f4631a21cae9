//! Opening and reading of scans.

use super::poses_document::{self, PosesDocument, PosesEntry};
use super::scan_set::{ScanSet, View};
use super::stanford_conf;
use super::view_ply::{Frame, parse_scan};
use crate::geometry::Pose;
use crate::mesh::io::{Unit, read_bytes};
use crate::scan::{PoseSigma, SensorKind, Support};
use crate::{Error, Result};
use rayon::prelude::*;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Name of the file with the poses in a scan folder.
const POSES_FILE: &str = "poses.json";

/// Scans with their poses, to be read view by view: points in files stay there until
/// they are asked for.
pub struct ScanSource {
    store: ViewStore,
    /// The noise family, if it is known.
    pub sensor: Option<SensorKind>,
    /// Standard deviation of the poses, if it is known.
    pub pose_sigma: Option<PoseSigma>,
    /// What the object stands on.
    pub support: Support,
    /// Nominal figures of the sensor as written in the file; null if there are none.
    pub nominal: Value,
}

/// Where the views are.
enum ViewStore {
    Files(ViewFiles),
    Memory(Vec<View>),
}

/// Views in files.
struct ViewFiles {
    /// The file with the poses.
    source: PathBuf,
    /// Folder of the clouds.
    folder: PathBuf,
    unit: Unit,
    entries: Vec<PosesEntry>,
    frame: Frame,
}

impl ScanSource {
    /// Opens a scan folder, its `poses.json`, or a Stanford `*.conf`; the lengths in them (points,
    /// poses, `pose_sigma`) are in `unit`.
    ///
    /// # Errors
    /// [`Error::Io`] if a file cannot be read or a view's cloud is missing, [`Error::Format`] with
    /// the view's name if something does not fit the format.
    pub fn open(path: &Path, unit: Unit) -> Result<ScanSource> {
        let (document, source) = read_document(path)?;
        let parsed = poses_document::parse(&document, &source, unit)?;
        let PosesDocument { entries, frame, sensor, pose_sigma, support, nominal, clouds_in } =
            parsed;
        let folder = source.with_file_name("").join(clouds_in);
        let files = ViewFiles { source, folder, unit, entries, frame };
        for (index, entry) in files.entries.iter().enumerate() {
            let cloud = files.cloud_path(index);
            if !cloud.is_file() {
                let message = format!(
                    "view {index} ({}): its cloud {} is missing; put it there or take the view out",
                    entry.name,
                    cloud.display()
                );
                return Err(Error::format(&files.source, message));
            }
        }
        Ok(ScanSource { store: ViewStore::Files(files), sensor, pose_sigma, support, nominal })
    }

    /// Scans that are in memory already.
    pub fn from_set(set: ScanSet) -> ScanSource {
        let ScanSet { views, sensor, pose_sigma, support, nominal } = set;
        ScanSource { store: ViewStore::Memory(views), sensor, pose_sigma, support, nominal }
    }

    /// Number of views.
    pub fn len(&self) -> usize {
        match &self.store {
            ViewStore::Files(files) => files.entries.len(),
            ViewStore::Memory(views) => views.len(),
        }
    }

    /// Whether there is no view; never so after [`ScanSource::open`].
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Name of view `index`.
    pub fn name(&self, index: usize) -> &str {
        match &self.store {
            ViewStore::Files(files) => &files.entries[index].name,
            ViewStore::Memory(views) => &views[index].name,
        }
    }

    /// The pose object_from_sensor of view `index`, metres.
    pub fn pose(&self, index: usize) -> Pose {
        match &self.store {
            ViewStore::Files(files) => files.entries[index].object_from_sensor,
            ViewStore::Memory(views) => views[index].object_from_sensor,
        }
    }

    /// View `index`, in metres.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Format`] if its cloud cannot be read, is malformed, holds no
    /// finite point, or seems to be in another unit.
    pub fn view(&self, index: usize) -> Result<View> {
        match &self.store {
            ViewStore::Files(files) => files.view(index),
            ViewStore::Memory(views) => Ok(views[index].clone()),
        }
    }

    /// The file that holds the poses and the unit of its lengths, if they came from one.
    pub(super) fn file(&self) -> Option<(&Path, Unit)> {
        match &self.store {
            ViewStore::Files(files) => Some((&files.source, files.unit)),
            ViewStore::Memory(_) => None,
        }
    }
}

impl ViewFiles {
    fn view(&self, index: usize) -> Result<View> {
        let entry = &self.entries[index];
        let path = self.cloud_path(index);
        let scan = parse_scan(&read_bytes(&path)?, &path, self.frame, self.unit, entry.width)
            .map_err(|error| match error {
                Error::Format { path, message } => {
                    Error::Format { path, message: format!("view {}: {message}", entry.name) }
                }
                other => other,
            })?;
        let object_from_sensor = entry.object_from_sensor;
        Ok(View { name: entry.name.clone(), scan, object_from_sensor })
    }

    fn cloud_path(&self, index: usize) -> PathBuf {
        self.folder.join(&self.entries[index].cloud)
    }
}

/// Reads all scans of a scan folder, its `poses.json`, or a Stanford `*.conf`; the lengths in them
/// are in `unit`, those of the result in metres. Range grids are turned into our sensor frame, with
/// parallel rays.
///
/// # Errors
/// As [`ScanSource::open`] and [`ScanSource::view`].
pub fn read_scans(path: &Path, unit: Unit) -> Result<ScanSet> {
    let files = ScanSource::open(path, unit)?;
    let views = (0..files.len()).into_par_iter().map(|i| files.view(i));
    // All are collected first, so that the error is that of the first view for any number of
    // threads.
    let views: Vec<Result<View>> = views.collect();
    Ok(ScanSet {
        views: views.into_iter().collect::<Result<_>>()?,
        sensor: files.sensor,
        pose_sigma: files.pose_sigma,
        support: files.support,
        nominal: files.nominal,
    })
}

/// The document of an input, and the file that it came from.
pub(super) fn read_document(path: &Path) -> Result<(Value, PathBuf)> {
    let source = find_source(path)?;
    let extension = source.extension().and_then(|e| e.to_str()).unwrap_or_default();
    let document = match extension.to_ascii_lowercase().as_str() {
        "json" => poses_document::parse_json(&read_bytes(&source)?, &source)?,
        "conf" => stanford_conf::to_document(&read_bytes(&source)?, &source)?,
        "ply" => {
            return Err(Error::format(
                &source,
                "is a single PLY, not scans with poses: give a scan folder (poses.json and one PLY a view)",
            ));
        }
        _ => {
            return Err(Error::format(
                &source,
                "holds no scans: give a scan folder, its poses.json, or a Stanford .conf",
            ));
        }
    };
    Ok((document, source))
}

/// The file with the poses: `path` itself, or in the folder `path` poses.json or else the only
/// `.conf`.
fn find_source(path: &Path) -> Result<PathBuf> {
    if !path.is_dir() {
        return Ok(path.to_path_buf());
    }
    let poses = path.join(POSES_FILE);
    if poses.is_file() {
        return Ok(poses);
    }
    let entries = std::fs::read_dir(path).map_err(|e| Error::io("read", path, e))?;
    let mut files: Vec<PathBuf> = entries.filter_map(|e| e.ok().map(|e| e.path())).collect();
    files.retain(|file| file.extension().is_some_and(|e| e == "conf"));
    match files.as_slice() {
        [conf] => Ok(conf.clone()),
        _ => Err(Error::format(
            path,
            format!(
                "has no {POSES_FILE}: a scan folder needs it, with a cloud and a pose for each view"
            ),
        )),
    }
}
