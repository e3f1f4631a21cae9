//! Where the surface is fitted.

use super::FilterParams;
use super::merged::Merged;
use crate::voxel::{CellIndex, most_central, sides};
use rayon::prelude::*;

/// In each cell of the reduction radius, the most central measurement of each side of the surface.
pub(super) fn seeds(merged: &Merged, reduction_radius: f64, params: &FilterParams) -> Vec<usize> {
    let cells = CellIndex::new(&merged.points, reduction_radius);
    let cosine = params.max_normal_angle.cos();
    let in_cell = |cell| {
        let found = sides(cells.points_in(cell), &merged.normals, cosine);
        found.iter().filter_map(|side| most_central(&merged.points, side)).collect()
    };
    let chosen: Vec<Vec<usize>> = cells.cells().par_iter().map(|&cell| in_cell(cell)).collect();
    chosen.into_iter().flatten().collect()
}
