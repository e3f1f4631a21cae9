//! Sparse voxel space (Wiedemann 2014, §2.1): space cut into cubes of edge `l`.
//!
//! [`VoxelSpace`] holds one value a voxel in blocks that exist only where something was written; [`BlockGrid`]
//! does the same within a box, faster, and with [`SlotSet`] for sets of its voxels; [`walk`] lists the voxels
//! along a ray; [`CellIndex`] sorts points into voxels for searches within a radius.

mod cells;
mod grid;
mod set;
mod sides;
mod space;
mod walk;

pub use cells::{CellIndex, most_central};
pub use grid::{BlockGrid, Step, Walk};
pub use set::SlotSet;
pub(crate) use sides::{keep_apart, sides};
pub use space::VoxelSpace;
pub use walk::walk;

use crate::geometry::Vec3;

/// Integer coordinates of a voxel: it covers `[v l, (v + 1) l)` in each axis.
pub type Voxel = [i32; 3];

/// The voxel of edge `edge` (metres) that holds `point`.
pub fn voxel_of(point: &Vec3, edge: f64) -> Voxel {
    [0, 1, 2].map(|i| (point[i] / edge).floor() as i32)
}

/// Centre of `voxel`, metres.
pub fn voxel_center(voxel: Voxel, edge: f64) -> Vec3 {
    Vec3::from_fn(|i, _| (f64::from(voxel[i]) + 0.5) * edge)
}
