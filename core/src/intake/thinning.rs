//! Parts of a scan.

use crate::geometry::{Scan, Vec3};
use crate::voxel::CellIndex;

/// The points of a scan, metres.
pub(super) fn points_of(scan: &Scan) -> Vec<Vec3> {
    scan.points.iter().map(|p| Vec3::from(p.map(f64::from))).collect()
}

/// The first point of each cubic cell of edge `cell` (metres).
pub(super) fn thin(scan: &Scan, cell: f64) -> Scan {
    let cells = CellIndex::new(&points_of(scan), cell);
    let first_of_each = cells.cells().iter().filter_map(|&cell| cells.points_in(cell).first());
    let kept: Vec<usize> = first_of_each.map(|&index| index as usize).collect();
    select(scan, &kept)
}

/// The points at `indices`, no longer in rows.
pub(super) fn select(scan: &Scan, indices: &[usize]) -> Scan {
    let origins = match scan.origins.as_slice() {
        [] => Vec::new(),
        origins => indices.iter().map(|&i| origins[i]).collect(),
    };
    Scan { points: indices.iter().map(|&i| scan.points[i]).collect(), width: 0, origins }
}
