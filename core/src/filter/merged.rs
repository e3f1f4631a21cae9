//! All scans' measurements in the object frame.

use crate::geometry::{NoiseModel, Pose, Vec3};
use crate::register::PreparedScan;
use crate::voxel::CellIndex;

/// No sensor is better, metres.
pub(super) const LEAST_SIGMA: f32 = 1e-6;

/// Measurements of all scans, object frame.
pub(super) struct Merged {
    pub points: Vec<Vec3>,
    /// Unit normals, towards the sensor.
    pub normals: Vec<Vec3>,
    /// Unit rays, away from the sensor.
    pub rays: Vec<Vec3>,
    /// The scan of each measurement.
    pub scan: Vec<u16>,
    /// Standard deviation along the normal, metres: of several scans that of their sensor.
    pub sigma: Vec<f32>,
    /// Distance of the sensor, metres.
    pub range: Vec<f32>,
    /// The noise of the sensor that took the scans, as each sees it for itself.
    pub sensor: NoiseModel,
    /// For searches within about the noise radius.
    pub cells: CellIndex,
}

impl Merged {
    pub(super) fn new(scans: &[(&PreparedScan, Pose)], noise_radius: f64) -> Merged {
        let total = scans.iter().map(|(scan, _)| scan.points.len()).sum();
        let mut merged = Merged {
            points: Vec::with_capacity(total),
            normals: Vec::with_capacity(total),
            rays: Vec::with_capacity(total),
            scan: Vec::with_capacity(total),
            sigma: Vec::with_capacity(total),
            range: Vec::with_capacity(total),
            sensor: NoiseModel::of_scans(scans.iter().map(|(scan, _)| &scan.model)),
            cells: CellIndex::new(&[], noise_radius),
        };
        for (index, (scan, pose)) in scans.iter().enumerate() {
            let count = scan.points.len();
            merged
                .points
                .extend(scan.points.iter().map(|p| pose.rotation * p + pose.translation.vector));
            merged.normals.extend(scan.normals.iter().map(|n| pose.rotation * n));
            merged.rays.extend(scan.rays.iter().map(|r| pose.rotation * r));
            merged.scan.extend(std::iter::repeat_n(index as u16, count));
            merged.range.extend_from_slice(&scan.range);
            merged.sigma.extend(scan.sigma.iter().map(|s| s.max(LEAST_SIGMA)));
        }
        merged.cells = CellIndex::new(&merged.points, noise_radius);
        if scans.len() > 1 {
            merged.sigma = merged.of_one_sensor();
        }
        merged
    }

    fn of_one_sensor(&self) -> Vec<f32> {
        let seen = self.range.iter().zip(&self.rays).zip(&self.normals);
        seen.map(|((range, ray), normal)| self.sensor.at(f64::from(*range), ray.dot(normal)) as f32)
            .map(|sigma| sigma.max(LEAST_SIGMA))
            .collect()
    }
}
