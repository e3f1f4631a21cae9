//! Values in sparse blocks of voxels.

use super::{Voxel, voxel_of, walk_ray};
use crate::geometry::Vec3;
use rustc_hash::FxHashMap;

/// Voxels along a block's edge; 8 makes a block of bytes fill eight cache lines.
const BLOCK_EDGE: i32 = 8;
const BLOCK_VOXELS: usize = (BLOCK_EDGE * BLOCK_EDGE * BLOCK_EDGE) as usize;

/// One value a voxel; voxels never written hold `T::default()`.
#[derive(Clone)]
pub struct VoxelSpace<T> {
    edge: f64,
    blocks: FxHashMap<Voxel, Box<[T; BLOCK_VOXELS]>>,
}

impl<T: Copy + Default + PartialEq> VoxelSpace<T> {
    /// An empty space of voxels with edge `edge` (metres).
    pub fn new(edge: f64) -> Self {
        VoxelSpace { edge, blocks: FxHashMap::default() }
    }

    /// Edge of a voxel, metres.
    pub fn edge(&self) -> f64 {
        self.edge
    }

    /// The voxel that holds `point`.
    pub fn voxel_of(&self, point: &Vec3) -> Voxel {
        voxel_of(point, self.edge)
    }

    /// The value of `voxel`.
    pub fn get(&self, voxel: Voxel) -> T {
        self.blocks
            .get(&block_of(voxel))
            .map_or_else(T::default, |block| block[offset_in_block(voxel)])
    }

    /// Sets the value of `voxel`.
    pub fn set(&mut self, voxel: Voxel, value: T) {
        let block = self
            .blocks
            .entry(block_of(voxel))
            .or_insert_with(|| Box::new([T::default(); BLOCK_VOXELS]));
        block[offset_in_block(voxel)] = value;
    }

    /// All voxels whose value is not the default, in ascending order of their coordinates.
    pub fn non_default(&self) -> Vec<(Voxel, T)> {
        let mut found = Vec::new();
        for (block, values) in &self.blocks {
            for (offset, &value) in values.iter().enumerate() {
                if value != T::default() {
                    found.push((voxel_in_block(*block, offset), value));
                }
            }
        }
        found.sort_unstable_by_key(|(voxel, _)| *voxel);
        found
    }

    /// The first voxel on the ray from `origin` along the unit vector `direction`, up to `reach`
    /// (metres), for whose value `is_wanted` is true, and the distance at which the ray enters it.
    pub fn find_first_on_ray(
        &self,
        origin: &Vec3,
        direction: &Vec3,
        reach: f64,
        is_wanted: impl Fn(T) -> bool,
    ) -> Option<(Voxel, f64)> {
        walk_ray(origin, direction, self.edge, reach).find(|(voxel, _)| is_wanted(self.get(*voxel)))
    }
}

fn block_of(voxel: Voxel) -> Voxel {
    voxel.map(|v| v.div_euclid(BLOCK_EDGE))
}

fn offset_in_block(voxel: Voxel) -> usize {
    let [x, y, z] = voxel.map(|v| v.rem_euclid(BLOCK_EDGE) as usize);
    (z * BLOCK_EDGE as usize + y) * BLOCK_EDGE as usize + x
}

fn voxel_in_block(block: Voxel, offset: usize) -> Voxel {
    let offset = offset as i32;
    let local =
        [offset % BLOCK_EDGE, offset / BLOCK_EDGE % BLOCK_EDGE, offset / (BLOCK_EDGE * BLOCK_EDGE)];
    [0, 1, 2].map(|i| block[i] * BLOCK_EDGE + local[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_set_is_got_and_listed_in_order() {
        let mut space = VoxelSpace::new(0.1);
        let voxels = [[-9, 3, 7], [0, 0, 0], [-1, -8, 8], [100, -100, 5]];
        for (i, voxel) in voxels.into_iter().enumerate() {
            space.set(voxel, i as u8 + 1);
        }
        assert_eq!(space.get([-9, 3, 7]), 1);
        assert_eq!(space.get([-9, 3, 6]), 0);
        let listed: Vec<Voxel> = space.non_default().into_iter().map(|(v, _)| v).collect();
        assert_eq!(listed, [[-9, 3, 7], [-1, -8, 8], [0, 0, 0], [100, -100, 5]]);
    }

    #[test]
    fn a_ray_finds_the_first_wanted_voxel_at_its_distance() {
        let mut space = VoxelSpace::new(0.5);
        space.set([10, 0, 0], 1_u8);
        space.set([14, 0, 0], 2_u8);
        let origin = Vec3::new(0.1, 0.1, 0.1);
        let (voxel, distance) =
            space.find_first_on_ray(&origin, &Vec3::x(), 10.0, |v| v > 0).unwrap();
        assert_eq!(voxel, [10, 0, 0]);
        assert!((distance - 4.9).abs() < 1e-12);
        assert_eq!(
            space.find_first_on_ray(&origin, &Vec3::x(), 10.0, |v| v == 2).unwrap().0,
            [14, 0, 0]
        );
        assert!(space.find_first_on_ray(&origin, &Vec3::x(), 4.0, |v| v > 0).is_none());
    }
}
