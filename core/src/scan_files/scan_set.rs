//! The scans of one object in memory.

use crate::geometry::{Pose, Scan};
use crate::scan::{PoseSigma, SensorKind, Support};

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

/// The scans of one object.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScanSet {
    /// The views, in the order in which they were taken.
    pub views: Vec<View>,
    /// The noise family, if it is known.
    pub sensor: Option<SensorKind>,
    /// Standard deviation of the poses, if it is known.
    pub pose_sigma: Option<PoseSigma>,
    /// What the object stands on.
    pub support: Support,
    /// Nominal figures of the sensor as written in the file; null if there are none.
    pub nominal: serde_json::Value,
}
