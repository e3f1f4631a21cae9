//! The measurements of all scans, pooled in the object frame.

use crate::geometry::{NoiseModel, Pose, Vec3, transform};
use crate::scan::PreparedScan;
use crate::voxel::CellIndex;
use crate::{Error, Result};

/// Smallest standard deviation of a measurement, metres. No sensor is better, and a measurement of
/// standard deviation 0 would have infinite weight.
pub(super) const MIN_SIGMA_M: f32 = 1e-6;

/// Scans that can be pooled: their indices, and the counts of scans in a cloud, have 16 bits.
const MAX_SCANS: usize = u16::MAX as usize;

/// The measurements of all scans in the object frame. All vectors have one element a measurement.
pub(super) struct PooledMeasurements {
    /// Positions, metres.
    pub points: Vec<Vec3>,
    /// Unit normals, towards the sensor.
    pub normals: Vec<Vec3>,
    /// Unit vectors along the rays, away from the sensor.
    pub rays: Vec<Vec3>,
    /// Index of the scan that each measurement comes from.
    pub scan: Vec<u16>,
    /// Standard deviation along the normal, metres. With several scans it follows from the noise
    /// model of their common sensor, with a single one from that of the scan.
    pub sigma: Vec<f32>,
    /// Distance from the sensor, metres.
    pub range: Vec<f32>,
    /// Noise model of the sensor: the median of those that the scans estimated by themselves.
    pub sensor: NoiseModel,
    /// Index for searches within about the noise radius.
    pub cells: CellIndex,
}

impl PooledMeasurements {
    /// Pools the measurements of `scans`, each with its pose `object_from_sensor`, for searches
    /// within about `noise_radius` (metres).
    ///
    /// # Errors
    /// [`Error::Input`] if there are more than 65,535 scans.
    pub(super) fn new(
        scans: &[(&PreparedScan, Pose)],
        noise_radius: f64,
    ) -> Result<PooledMeasurements> {
        if scans.len() > MAX_SCANS {
            return Err(Error::input(format!(
                "the filter combines at most {MAX_SCANS} scans, but {} were given: leave some out",
                scans.len()
            )));
        }
        let total = scans.iter().map(|(scan, _)| scan.points.len()).sum();
        let mut pooled = PooledMeasurements {
            points: Vec::with_capacity(total),
            normals: Vec::with_capacity(total),
            rays: Vec::with_capacity(total),
            scan: Vec::with_capacity(total),
            sigma: Vec::with_capacity(total),
            range: Vec::with_capacity(total),
            sensor: NoiseModel::median_of(scans.iter().map(|(scan, _)| &scan.model)),
            cells: CellIndex::new(&[], noise_radius),
        };
        for (index, (scan, pose)) in scans.iter().enumerate() {
            let count = scan.points.len();
            pooled.points.extend(scan.points.iter().map(|p| transform(pose, p)));
            pooled.normals.extend(scan.normals.iter().map(|n| pose.rotation * n));
            pooled.rays.extend(scan.rays.iter().map(|r| pose.rotation * r));
            pooled.scan.extend(std::iter::repeat_n(index as u16, count));
            pooled.range.extend_from_slice(&scan.range);
            pooled.sigma.extend(scan.sigma.iter().map(|s| s.max(MIN_SIGMA_M)));
        }
        pooled.cells = CellIndex::new(&pooled.points, noise_radius);
        if scans.len() > 1 {
            pooled.sigma = pooled.sensor_sigma();
        }
        Ok(pooled)
    }

    /// The standard deviation of each measurement by the noise model of the common sensor, metres.
    fn sensor_sigma(&self) -> Vec<f32> {
        let incidences = self.range.iter().zip(&self.rays).zip(&self.normals);
        incidences
            .map(|((range, ray), normal)| {
                self.sensor.sigma_at(f64::from(*range), ray.dot(normal)) as f32
            })
            .map(|sigma| sigma.max(MIN_SIGMA_M))
            .collect()
    }

    /// Multiplies each standard deviation with `correction` at the measurement's range and
    /// incidence.
    pub(super) fn scale_sigma(&mut self, correction: &NoiseModel) {
        for i in 0..self.points.len() {
            let cosine = self.rays[i].dot(&self.normals[i]);
            let factor = correction.sigma_at(f64::from(self.range[i]), cosine) as f32;
            self.sigma[i] = (self.sigma[i] * factor).max(MIN_SIGMA_M);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A scan of one point 0.5 m before the sensor, seen head on.
    fn scan_of_one_point(sigma: f32) -> PreparedScan {
        PreparedScan {
            points: vec![Vec3::z() * 0.5],
            normals: vec![-Vec3::z()],
            rays: vec![Vec3::z()],
            sigma: vec![sigma],
            range: vec![0.5],
            model: NoiseModel::constant(2e-4),
            ..PreparedScan::default()
        }
    }

    #[test]
    fn more_scans_than_indices_have_bits_for_are_an_error() {
        let empty = PreparedScan::default();
        let scans = vec![(&empty, Pose::identity()); MAX_SCANS + 1];
        let error = PooledMeasurements::new(&scans, 1e-3).err().unwrap().to_string();
        assert!(error.contains("65535") && error.contains("65536"), "{error}");
        assert!(PooledMeasurements::new(&scans[1..], 1e-3).is_ok());
    }

    #[test]
    fn measurements_are_moved_by_the_pose_of_their_scan() {
        let (one, two) = (scan_of_one_point(1e-4), scan_of_one_point(1e-4));
        let moved = Pose::translation(0.1, 0.2, 0.3);
        let pooled =
            PooledMeasurements::new(&[(&one, Pose::identity()), (&two, moved)], 1e-3).unwrap();
        assert!((pooled.points[1] - Vec3::new(0.1, 0.2, 0.8)).norm() < 1e-15);
        assert_eq!((pooled.scan, pooled.normals[1]), (vec![0, 1], -Vec3::z()));
        // Two scans have the noise of their sensor, not what each says of its points.
        assert!(pooled.sigma.iter().all(|s| (s - 2e-4).abs() < 1e-9), "{:?}", pooled.sigma);
    }

    #[test]
    fn no_standard_deviation_is_zero_and_corrections_multiply() {
        let mut pooled =
            PooledMeasurements::new(&[(&scan_of_one_point(0.0), Pose::identity())], 1e-3).unwrap();
        assert_eq!(pooled.sigma, [MIN_SIGMA_M]);
        pooled.scale_sigma(&NoiseModel::constant(3.0));
        assert!((pooled.sigma[0] / (3.0 * MIN_SIGMA_M) - 1.0).abs() < 1e-6);
    }
}
