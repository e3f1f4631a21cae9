//! One measurement as it is compared with the filtered cloud.

use crate::geometry::{Pose, Vec3, transform};
use crate::scan::PreparedScan;

/// One measurement in the object frame.
pub(super) struct Measurement {
    /// Position, metres.
    pub point: Vec3,
    /// Unit vector along the ray, away from the sensor.
    pub ray: Vec3,
    /// Distance from the sensor, metres.
    pub range: f64,
    /// Index in the raw scan.
    pub source: u32,
    /// Whether the scan alone gave it a normal: those without one are outliers more often.
    pub is_oriented: bool,
}

impl Measurement {
    /// All measurements of a scan at `pose`, first those that have a normal, then the others.
    pub(super) fn from_scan(scan: &PreparedScan, pose: &Pose) -> Vec<Measurement> {
        let oriented = (0..scan.points.len()).map(|i| Measurement {
            point: transform(pose, &scan.points[i]),
            ray: pose.rotation * scan.rays[i],
            range: f64::from(scan.range[i]),
            source: scan.raw_indices[i],
            is_oriented: true,
        });
        let unoriented = scan.unoriented.iter().map(|u| Measurement {
            point: transform(pose, &u.point),
            ray: pose.rotation * u.ray,
            range: f64::from(u.range),
            source: u.raw_index,
            is_oriented: false,
        });
        oriented.chain(unoriented).collect()
    }
}
