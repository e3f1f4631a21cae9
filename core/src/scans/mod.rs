//! Scan folders and other files that hold scans with their poses.
//!
//! A scan folder is `poses.json` and one PLY file a view; a Stanford `*.conf` names range-grid PLYs. Either is
//! opened with [`ScanSource::open`], which reads what is small, or read whole with [`read_scans`].

mod cloud;
mod conf;
mod document;
mod source;
mod write;

pub use crate::mesh::io::Unit;
pub use source::{ScanSource, read_scans};
pub use write::{ScanFolder, write_poses, write_scans};

use crate::geometry::{Pose, Scan};

/// One scan and where it was taken.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The name, one of its own in the set: that of its file without the extension.
    pub name: String,
    /// The points, sensor frame, metres.
    pub scan: Scan,
    /// The sensor's pose in the object frame.
    pub object_from_sensor: Pose,
}

/// The family of noise that a sensor has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorKind {
    /// Laser triangulation, profile by profile.
    Laser,
    /// Stereo camera.
    Stereo,
}

/// Standard deviations per axis of `xi` in `T_true = T exp(xi)` (right perturbation, sensor frame).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseSigma {
    /// Metres.
    pub translation: f64,
    /// Radians.
    pub rotation: f64,
}

crate::choice! {
    /// What the object stands on.
    #[derive(Default)]
    pub enum Support {
        /// Nothing that is known.
        #[default]
        None = "none",
        /// The plane z = 0 of the object frame, the object above it.
        Table = "table",
    }
}

/// The scans of one object.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScanSet {
    /// The views, in the order in which they were taken.
    pub views: Vec<View>,
    /// The noise family, if it is known.
    pub sensor: Option<SensorKind>,
    /// How uncertain the poses are, if it is known.
    pub pose_sigma: Option<PoseSigma>,
    /// What the object stands on.
    pub support: Support,
    /// Sensor figures as they stand in the file; null if there are none.
    pub nominal: serde_json::Value,
}

impl SensorKind {
    /// The word that stands for it in files.
    pub fn word(self) -> &'static str {
        match self {
            SensorKind::Laser => "laser",
            SensorKind::Stereo => "stereo",
        }
    }

    /// The kind that `word` stands for.
    pub fn from_word(word: &str) -> Option<SensorKind> {
        [SensorKind::Laser, SensorKind::Stereo].into_iter().find(|kind| kind.word() == word)
    }
}

#[cfg(test)]
mod tests;
