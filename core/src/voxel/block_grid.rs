//! Values in the voxels of a box, in blocks that exist only where something was written.
//!
//! The directory of blocks is a plain array, so that a voxel is found without hashing and
//! everything is listed in one fixed order.

use super::{Voxel, voxel_of};
use crate::geometry::{Aabb, Vec3};
use crate::{Error, Result};

/// Voxels along a block's edge, as a power of two.
const BLOCK_BITS: u32 = 3;
/// The bits of a voxel's coordinate that count within its block.
const BLOCK_MASK: i32 = (1 << BLOCK_BITS) - 1;
/// Voxels of a block.
const BLOCK_VOXELS: usize = 1 << (3 * BLOCK_BITS);
/// Entry of the directory for a block that does not exist.
const ABSENT_BLOCK: u32 = u32::MAX;
/// A box of more voxels is refused: a set of one bit a voxel would be far larger than a processor's
/// cache.
const MAX_VOXELS: f64 = 5e8;
/// Largest coordinate of a voxel: sums and differences of a few of them must fit an `i32`.
const MAX_COORDINATE: f64 = (i32::MAX / 4) as f64;

/// One value for each voxel of a box; voxels never written hold `T::default()`. A voxel is named by
/// its slot, a number below [`BlockGrid::slots`].
#[derive(Clone)]
pub struct BlockGrid<T> {
    edge: f64,
    low: Voxel,
    /// Voxels in each axis.
    size: [i32; 3],
    /// Blocks in each axis.
    blocks: [i32; 3],
    directory: Vec<u32>,
    values: Vec<T>,
    empty: T,
}

/// A voxel that a ray crosses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayStep {
    /// The voxel.
    pub slot: u32,
    /// Distance from the ray's origin where the ray enters it, metres.
    pub enter: f64,
    /// Distance where the ray leaves it, metres.
    pub leave: f64,
}

impl<T: Copy + Default> BlockGrid<T> {
    /// An empty grid of the voxels of edge `edge` (metres) that share a point with `bounds`
    /// (metres).
    ///
    /// # Errors
    /// [`Error::Input`] if the box is empty or not finite, the edge is not positive, or there are
    /// too many voxels.
    pub fn new(bounds: &Aabb, edge: f64) -> Result<BlockGrid<T>> {
        let extent = bounds.max - bounds.min;
        let sound = edge > 0.0 && edge.is_finite() && extent.iter().all(|e| *e > 0.0);
        if !sound || !extent.iter().chain(bounds.min.iter()).all(|e| e.is_finite()) {
            return Err(Error::input(format!(
                "no voxels of {edge} m in a box from {:?} to {:?} m: the edge must be positive and the box \
                 finite, its first corner below its second in x, y and z",
                bounds.min.as_slice(),
                bounds.max.as_slice()
            )));
        }
        // A block more in each axis, since the outermost ones may reach beyond the box.
        let block = f64::from(1 << BLOCK_BITS);
        let count = extent.iter().map(|e| (e / edge).ceil() + block).product::<f64>();
        let far = bounds.min.amax().max(bounds.max.amax()) / edge;
        if count > MAX_VOXELS || far > MAX_COORDINATE {
            return Err(Error::input(format!(
                "a box of {:?} m holds {count:.1e} voxels of {edge} m, more than {MAX_VOXELS:.0e}: take a \
                 smaller box or larger voxels",
                extent.as_slice()
            )));
        }
        let (low, high) = (voxel_of(&bounds.min, edge), voxel_of(&bounds.max, edge));
        let size = [0, 1, 2].map(|i| high[i] - low[i] + 1);
        let blocks = size.map(|s| (s + BLOCK_MASK) >> BLOCK_BITS);
        let directory = vec![ABSENT_BLOCK; blocks.iter().map(|b| *b as usize).product()];
        Ok(BlockGrid {
            edge,
            low,
            size,
            blocks,
            directory,
            values: Vec::new(),
            empty: T::default(),
        })
    }

    /// Edge of a voxel, metres.
    pub fn edge(&self) -> f64 {
        self.edge
    }

    /// Number of slots, including those of voxels beyond the box in the outermost blocks.
    pub fn slots(&self) -> usize {
        self.directory.len() * BLOCK_VOXELS
    }

    /// Number of voxels in the box.
    pub fn voxels(&self) -> usize {
        self.size.iter().map(|s| *s as usize).product()
    }

    /// Bytes that the blocks and their directory take.
    pub fn memory(&self) -> usize {
        self.values.capacity() * size_of::<T>() + self.directory.capacity() * size_of::<u32>()
    }

    /// The slot of `voxel`; `None` outside the box.
    pub fn slot(&self, voxel: Voxel) -> Option<u32> {
        let local = self.local(voxel);
        (0..3).all(|i| (0..self.size[i]).contains(&local[i])).then(|| self.slot_of_local(local))
    }

    /// The voxel counted from the lowest of the box. The voxel of a point far off saturates at the
    /// ends of the integers.
    fn local(&self, voxel: Voxel) -> Voxel {
        [0, 1, 2].map(|i| voxel[i].saturating_sub(self.low[i]))
    }

    /// The slot of the voxel that holds `point`; `None` outside the box.
    pub fn slot_at(&self, point: &Vec3) -> Option<u32> {
        self.slot(voxel_of(point, self.edge))
    }

    /// The voxel of a slot.
    pub fn voxel(&self, slot: u32) -> Voxel {
        let (block, offset) = (slot as i32 >> (3 * BLOCK_BITS), slot as i32);
        let [bx, by, _] = self.blocks;
        let block = [block % bx, block / bx % by, block / (bx * by)];
        [0, 1, 2].map(|i| {
            let inner = offset >> (BLOCK_BITS * i as u32) & BLOCK_MASK;
            self.low[i] + (block[i] << BLOCK_BITS) + inner
        })
    }

    /// Centre of a slot's voxel, metres.
    pub fn center(&self, slot: u32) -> Vec3 {
        super::voxel_center(self.voxel(slot), self.edge)
    }

    /// The value in `slot`.
    pub fn get(&self, slot: u32) -> &T {
        match self.directory[slot as usize / BLOCK_VOXELS] {
            ABSENT_BLOCK => &self.empty,
            block => &self.values[block as usize * BLOCK_VOXELS + slot as usize % BLOCK_VOXELS],
        }
    }

    /// The value in `slot`, for writing; its block is made if it does not exist.
    pub fn get_mut(&mut self, slot: u32) -> &mut T {
        let entry = &mut self.directory[slot as usize / BLOCK_VOXELS];
        if *entry == ABSENT_BLOCK {
            *entry = (self.values.len() / BLOCK_VOXELS) as u32;
            self.values.resize(self.values.len() + BLOCK_VOXELS, T::default());
        }
        &mut self.values[*entry as usize * BLOCK_VOXELS + slot as usize % BLOCK_VOXELS]
    }

    /// Slots and values of all blocks that exist, ascending by slot.
    pub fn iter(&self) -> impl Iterator<Item = (u32, &T)> + '_ {
        self.directory.iter().enumerate().filter(|(_, block)| **block != ABSENT_BLOCK).flat_map(
            move |(at, block)| {
                let first = *block as usize * BLOCK_VOXELS;
                let values = &self.values[first..first + BLOCK_VOXELS];
                (at as u32 * BLOCK_VOXELS as u32..).zip(values)
            },
        )
    }

    /// Those of the six voxels face to face with one that lie in the box.
    pub fn neighbours(&self, slot: u32) -> impl Iterator<Item = u32> + use<'_, T> {
        let voxel = self.voxel(slot);
        (0..6).filter_map(move |side| {
            let mut next = voxel;
            next[side / 2] += if side % 2 == 0 { -1 } else { 1 };
            self.slot(next)
        })
    }

    /// A voxel and the 26 that touch it, as far as they lie in the box.
    pub fn cube_around(&self, slot: u32) -> impl Iterator<Item = u32> + use<'_, T> {
        let [x, y, z] = self.voxel(slot);
        (0..27).filter_map(move |i| self.slot([x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]))
    }

    /// The voxels of the box along the ray from `origin` in the unit vector `direction`, between
    /// the distances `near` and `far` (metres), in order (Amanatides & Woo 1987).
    pub fn walk_ray(&self, origin: &Vec3, direction: &Vec3, near: f64, far: f64) -> RayWalk<'_, T> {
        let (mut from, mut to) = (near.max(0.0), far);
        for i in 0..3 {
            let [a, b] = [self.low[i], self.low[i] + self.size[i]]
                .map(|v| f64::from(v) * self.edge - origin[i]);
            if direction[i] != 0.0 {
                let (a, b) = (a / direction[i], b / direction[i]);
                (from, to) = (from.max(a.min(b)), to.min(a.max(b)));
            } else if a > 0.0 || b <= 0.0 {
                to = f64::NEG_INFINITY;
            }
        }
        let start = origin + direction * from;
        let local = self.local(voxel_of(&start, self.edge));
        let local = [0, 1, 2].map(|i| local[i].clamp(0, self.size[i] - 1));
        let step = [0, 1, 2].map(|i| direction[i].partial_cmp(&0.0).map_or(0, |o| o as i32));
        let next = [0, 1, 2].map(|i| {
            let border = f64::from(self.low[i] + local[i] + i32::from(step[i] > 0)) * self.edge;
            if step[i] == 0 { f64::INFINITY } else { (border - origin[i]) / direction[i] }
        });
        let delta = [0, 1, 2].map(|i| (self.edge / direction[i]).abs());
        RayWalk { grid: self, local, step, next, delta, at: from, to }
    }

    fn slot_of_local(&self, [x, y, z]: [i32; 3]) -> u32 {
        let [bx, by, _] = self.blocks;
        let block = ((z >> BLOCK_BITS) * by + (y >> BLOCK_BITS)) * bx + (x >> BLOCK_BITS);
        let inner =
            (z & BLOCK_MASK) << (2 * BLOCK_BITS) | (y & BLOCK_MASK) << BLOCK_BITS | x & BLOCK_MASK;
        (block << (3 * BLOCK_BITS) | inner) as u32
    }
}

/// The voxels along a ray, see [`BlockGrid::walk_ray`].
pub struct RayWalk<'a, T> {
    grid: &'a BlockGrid<T>,
    local: [i32; 3],
    step: [i32; 3],
    next: [f64; 3],
    delta: [f64; 3],
    at: f64,
    to: f64,
}

impl<T: Copy + Default> Iterator for RayWalk<'_, T> {
    type Item = RayStep;

    fn next(&mut self) -> Option<RayStep> {
        if self.at >= self.to {
            return None;
        }
        let axis = usize::from(self.next[1] < self.next[0]);
        let axis = if self.next[2] < self.next[axis] { 2 } else { axis };
        let slot = self.grid.slot_of_local(self.local);
        let step = RayStep { slot, enter: self.at, leave: self.next[axis].max(self.at) };
        self.at = step.leave;
        self.local[axis] += self.step[axis];
        self.next[axis] += self.delta[axis];
        if self.local[axis] < 0 || self.local[axis] >= self.grid.size[axis] {
            self.to = f64::NEG_INFINITY;
        }
        Some(step)
    }
}

#[cfg(test)]
#[path = "block_grid_tests.rs"]
mod tests;
