//! All scans' measurements in the object frame.

use crate::geometry::{Pose, Vec3};
use crate::register::PreparedScan;

/// Measurements of all scans, object frame.
pub(super) struct Merged {
    pub points: Vec<Vec3>,
    /// Unit normals, towards the sensor.
    pub normals: Vec<Vec3>,
    /// Unit rays, away from the sensor.
    pub rays: Vec<Vec3>,
    /// The scan of each measurement.
    pub scan: Vec<u16>,
    /// Standard deviation within its scan, metres.
    pub noise: Vec<f32>,
}

impl Merged {
    pub(super) fn new(scans: &[(&PreparedScan, Pose)]) -> Merged {
        let total = scans.iter().map(|(scan, _)| scan.points.len()).sum();
        let mut merged = Merged {
            points: Vec::with_capacity(total),
            normals: Vec::with_capacity(total),
            rays: Vec::with_capacity(total),
            scan: Vec::with_capacity(total),
            noise: Vec::with_capacity(total),
        };
        for (index, (scan, pose)) in scans.iter().enumerate() {
            let count = scan.points.len();
            merged
                .points
                .extend(scan.points.iter().map(|p| pose.rotation * p + pose.translation.vector));
            merged.normals.extend(scan.normals.iter().map(|n| pose.rotation * n));
            merged.rays.extend(scan.rays.iter().map(|r| pose.rotation * r));
            merged.scan.extend(std::iter::repeat_n(index as u16, count));
            merged.noise.extend(std::iter::repeat_n(scan.noise.max(1e-6) as f32, count));
        }
        merged
    }
}
