//! The points of a raw scan that have a return.

use super::normals::{Neighbourhood, PointNormals};
use super::spacing::median_spacing;
use crate::geometry::{NoiseModel, RangeResidual, Scan, Vec3};
use crate::voxel::CellIndex;
use rayon::prelude::*;

/// Residuals from which the noise is estimated by range and incidence: some thousand a class.
const MAX_RESIDUALS: usize = 20_000;
/// Radius, in spacings, of the planes whose residuals the noise is estimated from: within it the
/// curvature of the surface does not count.
const RESIDUAL_RADIUS_SPACINGS: f64 = 2.0;
/// Points of a scan that are kept at most: above, neighbours are merged, which loses no information
/// because such scans are far denser than the finest mesh made of them.
const MAX_POINTS: usize = 200_000;
/// Edge of the cells within which points are merged where most of them coincide, metres.
const MIN_CELL_M: f64 = 1e-6;

/// The returns of a scan, thinned if there are too many; sensor frame.
pub(super) struct Returns {
    /// Metres.
    pub points: Vec<Vec3>,
    /// Unit vectors along the rays, away from the sensor.
    pub rays: Vec<Vec3>,
    /// Distances from the sensor, metres.
    pub ranges: Vec<f64>,
    /// Which point of the raw scan each was; the first of those that were merged.
    pub raw_indices: Vec<u32>,
}

impl Returns {
    pub(super) fn new(scan: &Scan) -> Returns {
        let indices: Vec<usize> = scan.returns().collect();
        let points: Vec<Vec3> =
            indices.iter().map(|&i| scan.point(i).unwrap_or_else(Vec3::zeros)).collect();
        let sight: Vec<Vec3> =
            indices.iter().zip(&points).map(|(&i, point)| point - scan.origin(i)).collect();
        let returns = Returns {
            points,
            rays: sight.iter().map(direction_or_z).collect(),
            ranges: sight.iter().map(Vec3::norm).collect(),
            raw_indices: indices.iter().map(|&i| i as u32).collect(),
        };
        if indices.len() <= MAX_POINTS { returns } else { returns.thinned() }
    }

    /// The returns with those in one cell of a grid merged, so that about [`MAX_POINTS`] remain.
    fn thinned(&self) -> Returns {
        let count = self.points.len() as f64;
        let mut edge = median_spacing(&self.points) * (count / MAX_POINTS as f64).sqrt();
        if edge <= 0.0 {
            edge = MIN_CELL_M;
        }
        let index = CellIndex::new(&self.points, edge);
        let cells: Vec<&[u32]> = index.cells().iter().map(|&cell| index.points_in(cell)).collect();
        Returns {
            points: cells.iter().map(|members| mean_of(&self.points, members)).collect(),
            rays: cells
                .iter()
                .map(|members| direction_or_z(&mean_of(&self.rays, members)))
                .collect(),
            ranges: cells.iter().map(|members| self.ranges[members[0] as usize]).collect(),
            raw_indices: cells
                .iter()
                .map(|members| self.raw_indices[members[0] as usize])
                .collect(),
        }
    }

    /// The noise by range and incidence, from the distances of the points to small planes;
    /// `normals` has an entry a point, `spacing` is the distance between points, metres. None if
    /// there are too few residuals.
    pub(super) fn noise_model(
        &self,
        normals: &[Option<PointNormals>],
        spacing: f64,
    ) -> Option<NoiseModel> {
        let near = Neighbourhood::new(&self.points, RESIDUAL_RADIUS_SPACINGS * spacing);
        let stride = normals.len().div_ceil(MAX_RESIDUALS).max(1);
        let probes: Vec<usize> = (0..normals.len()).step_by(stride).collect();
        let residuals: Vec<Option<RangeResidual>> =
            probes.par_iter().map(|&i| self.residual(i, normals[i].as_ref()?, &near)).collect();
        let residuals: Vec<RangeResidual> = residuals.into_iter().flatten().collect();
        NoiseModel::estimate(&residuals).map(NoiseModel::nondecreasing)
    }

    /// The distance of point `i` to the plane through its neighbours.
    fn residual(
        &self,
        i: usize,
        normals: &PointNormals,
        near: &Neighbourhood,
    ) -> Option<RangeResidual> {
        let fit = near.fit(i)?;
        let distance = (self.points[i] - fit.center).dot(&fit.normal);
        Some(RangeResidual {
            range: self.ranges[i],
            cosine: normals.sharp.dot(&self.rays[i]).abs(),
            // In the middle of its neighbours a point's leverage in their plane is 1 / count.
            distance: distance / (1.0 - 1.0 / fit.count).sqrt(),
        })
    }
}

/// The mean of the vectors at the indices `members`.
fn mean_of(vectors: &[Vec3], members: &[u32]) -> Vec3 {
    members.iter().map(|&i| vectors[i as usize]).sum::<Vec3>() / members.len() as f64
}

/// The unit vector along `vector`; along z if it has no length.
fn direction_or_z(vector: &Vec3) -> Vec3 {
    vector.try_normalize(0.0).unwrap_or_else(Vec3::z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_without_a_return_are_left_out_and_rays_lead_away_from_the_sensor() {
        let scan = Scan {
            points: vec![[0.0, 0.0, 2.0], [f32::NAN; 3], [0.0, 3.0, 4.0]],
            ..Scan::default()
        };
        let returns = Returns::new(&scan);
        assert_eq!(returns.raw_indices, [0, 2]);
        assert_eq!(returns.ranges, [2.0, 5.0]);
        assert_eq!(returns.rays, [Vec3::z(), Vec3::new(0.0, 0.6, 0.8)]);
    }

    #[test]
    fn a_scan_of_too_many_points_is_thinned_and_keeps_its_surface() {
        let side = 500;
        let points = (0..side * side)
            .map(|i| [(i % side) as f32 * 1e-4, (i / side) as f32 * 1e-4, 0.5])
            .collect();
        let returns = Returns::new(&Scan { points, ..Scan::default() });
        assert!(returns.points.len() <= MAX_POINTS && returns.points.len() > MAX_POINTS / 3);
        assert!(returns.points.iter().all(|p| (p.z - 0.5).abs() < 1e-9));
        assert!(returns.raw_indices.is_sorted_by(|a, b| a != b));
    }
}
