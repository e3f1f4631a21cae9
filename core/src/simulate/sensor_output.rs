//! What a simulated sensor delivers, with what only the simulation knows of it.

use super::labels::GOOD_LABEL;
use crate::geometry::{Scan, Vec3};

/// One measurement of a ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MeasuredPoint {
    /// The point in the sensor frame, metres; NaN without a return.
    pub point: [f32; 3],
    /// Its label; see [`super::labels`].
    pub label: u8,
}

impl MeasuredPoint {
    /// A ray without a return.
    pub(crate) const NO_RETURN: MeasuredPoint =
        MeasuredPoint { point: NO_POINT, label: GOOD_LABEL };
}

/// The coordinates of a point that does not exist.
pub(crate) const NO_POINT: [f32; 3] = [f32::NAN; 3];

/// A simulated scan.
pub(crate) struct SensorOutput {
    pub scan: Scan,
    /// The label of each point of the scan.
    pub labels: Vec<u8>,
    /// The noise-free hit of each ray in the sensor frame, metres; NaN for none.
    pub hits: Vec<[f32; 3]>,
}

impl SensorOutput {
    /// The output for points that were measured row by row.
    pub(crate) fn new(
        rows: &[Vec<MeasuredPoint>],
        width: usize,
        origins: Vec<[f32; 3]>,
        hits: Vec<[f32; 3]>,
    ) -> SensorOutput {
        let points = rows.iter().flatten().map(|measured| measured.point).collect();
        let labels = rows.iter().flatten().map(|measured| measured.label).collect();
        SensorOutput { scan: Scan { points, width, origins }, labels, hits }
    }
}

/// The vector in single precision, as a scan holds it.
pub(crate) fn single_precision(v: &Vec3) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}
