//! The measurements at which surfaces are fitted.

use crate::filter::params::FilterParams;
use crate::filter::pooled::PooledMeasurements;
use crate::voxel::{CellIndex, nearest_to_mean, split_by_side};
use rayon::prelude::*;

/// In each cubic cell of edge `reduction_radius` (metres), the most central measurement of each
/// side of the surface: indices, ascending by cell.
pub(crate) fn find_seeds(
    pooled: &PooledMeasurements,
    reduction_radius: f64,
    params: &FilterParams,
) -> Vec<usize> {
    let cells = CellIndex::new(&pooled.points, reduction_radius);
    let cosine = params.max_normal_angle.cos();
    let seeds: Vec<Vec<usize>> = cells
        .cells()
        .par_iter()
        .map(|&cell| {
            let sides = split_by_side(cells.points_in(cell), &pooled.normals, cosine);
            sides.iter().filter_map(|side| nearest_to_mean(&pooled.points, side)).collect()
        })
        .collect();
    seeds.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Pose, Vec3};
    use crate::scan::PreparedScan;

    #[test]
    fn each_side_of_a_cell_has_its_most_central_measurement() {
        // Three points seen from one side and two from the other, all in one cell of 10 mm.
        let x = [0.001, 0.002, 0.004, 0.005, 0.006];
        let down = [true, true, true, false, false];
        let normals: Vec<Vec3> =
            down.iter().map(|d| if *d { -Vec3::z() } else { Vec3::z() }).collect();
        let scan = PreparedScan {
            points: x.iter().map(|x| Vec3::new(*x, 0.005, 0.005)).collect(),
            rays: normals.iter().map(|n| -n).collect(),
            normals,
            sigma: vec![1e-4; 5],
            range: vec![0.5; 5],
            ..PreparedScan::default()
        };
        let pooled = PooledMeasurements::new(&[(&scan, Pose::identity())], 0.01).unwrap();
        let mut seeds = find_seeds(&pooled, 0.01, &FilterParams::default());
        seeds.sort_unstable();
        assert_eq!(seeds.len(), 2);
        // The mean of the first three is 2.33 mm: the second is nearest to it.
        assert_eq!(seeds[0], 1);
        assert!(seeds[1] >= 3);
    }
}
