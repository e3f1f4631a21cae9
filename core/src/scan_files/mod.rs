//! Reading and writing scan folders and other files that hold scans with their poses.
//!
//! A scan folder is `poses.json` and one PLY file a view; a Stanford `*.conf` names range-grid
//! PLYs. Either is opened with [`ScanSource::open`], which reads what is small, or read whole with
//! [`read_scans`].
//!
//! ```
//! use puffer_core::geometry::{Pose, Scan};
//! use puffer_core::scan_files::{ScanSet, Unit, View, read_scans, write_scans};
//!
//! let scan = Scan { points: vec![[0.0, 0.0, 0.5], [0.01, 0.0, 0.5]], ..Scan::default() };
//! let object_from_sensor = Pose::translation(0.1, 0.0, 0.0);
//! let view = View { name: "front".to_owned(), scan, object_from_sensor };
//! let set = ScanSet { views: vec![view], ..ScanSet::default() };
//! # let folder = tempfile::tempdir().map_err(|e| puffer_core::Error::input(e.to_string()))?;
//! let path = folder.path().join("scans");
//! write_scans(&path, &set, &[])?;
//! assert_eq!(read_scans(&path, Unit::Metre)?.views[0].scan, set.views[0].scan);
//! # Ok::<(), puffer_core::Error>(())
//! ```

mod poses_document;
mod scan_folder;
mod scan_set;
mod scan_source;
mod stanford_conf;
mod view_ply;

pub use crate::mesh::io::Unit;
pub use scan_folder::{ScanFolder, write_poses, write_scans};
pub use scan_set::{ScanSet, View};
pub use scan_source::{ScanSource, read_scans};

#[cfg(test)]
mod tests;
