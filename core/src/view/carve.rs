//! What one scan says of the voxels.

use super::cell::{Cell, State};
use crate::geometry::{Pose, Scan, Vec3};
use crate::voxel::{BlockGrid, SlotSet};
use nalgebra::Point3;
use rayon::prelude::*;

/// A ray says that a voxel is no surface only if it leaves it this many voxels before its end: nearer, noise and the
/// cut into voxels cannot be told from a surface.
const CLEAR: f64 = 1.0;
/// Rays in a batch; each batch has its own sets.
const BATCH: usize = 16_384;

/// What one scan says.
pub(crate) struct Carved {
    /// Voxels with points and their number.
    pub hits: Vec<(u32, u32)>,
    pub hit: SlotSet,
    /// Voxels that a ray went through before its end.
    pub freed: SlotSet,
    /// Of those, the ones well before the end.
    pub passed: SlotSet,
    /// Voxels behind the end of a ray.
    pub behind: SlotSet,
}

/// A measured ray, object frame.
struct Ray {
    origin: Vec3,
    direction: Vec3,
    length: f64,
}

/// Carves the scan from `pose`. Points with fewer than `min_support` in their voxel and the 26 around are left out.
pub(crate) fn carve(
    grid: &BlockGrid<Cell>,
    scan: &Scan,
    pose: &Pose,
    min_support: usize,
) -> Carved {
    let mut ends = ends(grid, scan, pose);
    let slots = grid.slots();
    let mut all = Vec::new();
    let mut hit = SlotSet::new(slots);
    for group in ends.chunk_by(|a, b| a.0 >> 3 == b.0 >> 3) {
        all.push(((group[0].0 >> 3) as u32, group.len() as u32));
    }
    let supported = |&(slot, own): &(u32, u32)| {
        own as usize >= min_support
            || around(grid, slot).map(|s| points_in(&all, s)).sum::<usize>() >= min_support
    };
    let hits: Vec<(u32, u32)> = all.iter().copied().filter(supported).collect();
    for &(slot, _) in &hits {
        hit.insert(slot);
    }
    // One ray for each eighth of a voxel: its neighbours carve the same voxels.
    ends.dedup_by_key(|(cell, _)| *cell);
    ends.retain(|(cell, _)| hit.contains((cell >> 3) as u32));
    let rays: Vec<u32> = ends.into_iter().map(|(_, index)| index).collect();
    let empty = || [(); 3].map(|()| SlotSet::new(slots));
    let unite = |mut a: [SlotSet; 3], b: [SlotSet; 3]| {
        a.iter_mut().zip(&b).for_each(|(a, b)| a.unite(b));
        a
    };
    let batch = |indices: &[u32]| {
        let mut sets = empty();
        for &index in indices {
            if let Some(ray) = ray(scan, pose, index as usize) {
                carve_ray(grid, &ray, &mut sets);
            }
        }
        sets
    };
    let [freed, passed, behind] = rays.par_chunks(BATCH).map(batch).reduce(empty, unite);
    Carved { hits, hit, freed, passed, behind }
}

/// Adds what rays say that ended beyond the object, on `beyond`: nothing stood before their ends.
pub(crate) fn see_past(grid: &BlockGrid<Cell>, beyond: &Scan, pose: &Pose, carved: &mut Carved) {
    let indices: Vec<usize> = beyond.returns().collect();
    let empty = || SlotSet::new(grid.slots());
    let batch = |indices: &[usize]| {
        let mut freed = empty();
        for ray in indices.iter().filter_map(|&index| ray(beyond, pose, index)) {
            // The end itself is somebody else's surface.
            let clear = ray.length - CLEAR * grid.edge();
            for step in grid.walk(&ray.origin, &ray.direction, 0.0, clear.max(0.0)) {
                if step.leave <= clear {
                    freed.insert(step.slot);
                }
            }
        }
        freed
    };
    let unite = |mut a: SlotSet, b: SlotSet| {
        a.unite(&b);
        a
    };
    let freed = indices.par_chunks(BATCH).map(batch).reduce(empty, unite);
    carved.freed.unite(&freed);
    carved.passed.unite(&freed);
}

/// The eighth of a voxel (slot * 8 + part) in which each point lies and the point's index, sorted; points
/// outside the grid or in solid space are left out.
fn ends(grid: &BlockGrid<Cell>, scan: &Scan, pose: &Pose) -> Vec<(u64, u32)> {
    let matrix = pose.rotation.to_rotation_matrix();
    let end = |(index, p): (usize, &[f32; 3])| {
        let p = Vec3::new(p[0].into(), p[1].into(), p[2].into());
        let p = matrix * p + pose.translation.vector;
        let slot = p.iter().all(|v| v.is_finite()).then(|| grid.slot_at(&p))??;
        let part = |axis: usize| u64::from((p[axis] / grid.edge()).rem_euclid(1.0) >= 0.5) << axis;
        let solid = grid.get(slot).state == State::Excluded;
        let cell = u64::from(slot) << 3 | part(0) | part(1) | part(2);
        (!solid).then_some((cell, index as u32))
    };
    let mut ends: Vec<(u64, u32)> = scan.points.par_iter().enumerate().filter_map(end).collect();
    ends.par_sort_unstable();
    ends
}

fn ray(scan: &Scan, pose: &Pose, index: usize) -> Option<Ray> {
    let place = |p: Vec3| pose.transform_point(&Point3::from(p)).coords;
    let (origin, end) = (place(scan.origin(index)), place(scan.point(index)?));
    let length = (end - origin).norm();
    (length > 0.0).then(|| Ray { origin, direction: (end - origin) / length, length })
}

fn carve_ray(grid: &BlockGrid<Cell>, ray: &Ray, [freed, passed, behind]: &mut [SlotSet; 3]) {
    let clear = ray.length - CLEAR * grid.edge();
    for step in grid.walk(&ray.origin, &ray.direction, 0.0, f64::INFINITY) {
        if step.leave <= ray.length {
            freed.insert(step.slot);
            if step.leave <= clear {
                passed.insert(step.slot);
            }
        } else if step.enter > ray.length {
            behind.insert(step.slot);
        }
    }
}

/// A voxel and the 26 around it, as far as they lie in the grid.
fn around(grid: &BlockGrid<Cell>, slot: u32) -> impl Iterator<Item = u32> + '_ {
    let [x, y, z] = grid.voxel(slot);
    (0..27).filter_map(move |i| grid.slot([x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]))
}

fn points_in(all: &[(u32, u32)], slot: u32) -> usize {
    all.binary_search_by_key(&slot, |(s, _)| *s).map_or(0, |at| all[at].1 as usize)
}
