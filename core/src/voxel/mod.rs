//! Sparse voxel space (Wiedemann 2014, §2.1): space divided into cubes of edge `l`.
//!
//! [`VoxelSpace`] holds one value a voxel in blocks that exist only where something was written;
//! [`BlockGrid`] does the same within a box, faster, with [`SlotSet`] for sets of its voxels;
//! [`walk_ray`] lists the voxels along a ray; [`CellIndex`] sorts points into voxels for searches
//! within a radius.
//!
//! ```
//! use puffer_core::geometry::Vec3;
//! use puffer_core::voxel::walk_ray;
//!
//! let walk = walk_ray(&Vec3::new(0.05, 0.05, 0.05), &Vec3::x(), 0.1, 0.2);
//! let voxels: Vec<_> = walk.map(|(voxel, _)| voxel).collect();
//! assert_eq!(voxels, [[0, 0, 0], [1, 0, 0], [2, 0, 0]]);
//! ```

mod block_grid;
mod cell_index;
mod ray_walk;
mod slot_set;
mod surface_sides;
mod voxel_space;

pub use block_grid::{BlockGrid, RayStep, RayWalk};
pub use cell_index::{CellIndex, nearest_to_mean};
pub use ray_walk::walk_ray;
pub use slot_set::SlotSet;
pub(crate) use surface_sides::{split_by_side, thin_by_distance};
pub use voxel_space::VoxelSpace;

use crate::geometry::Vec3;

/// Integer coordinates of a voxel: it covers `[v l, (v + 1) l)` in each axis.
pub type Voxel = [i32; 3];

/// The voxel of edge `edge` (metres) that holds `point` (metres).
pub fn voxel_of(point: &Vec3, edge: f64) -> Voxel {
    [0, 1, 2].map(|i| (point[i] / edge).floor() as i32)
}

/// Centre of `voxel`, metres.
pub fn voxel_center(voxel: Voxel, edge: f64) -> Vec3 {
    Vec3::from_fn(|i, _| (f64::from(voxel[i]) + 0.5) * edge)
}
