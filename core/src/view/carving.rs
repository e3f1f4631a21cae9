//! Space carving: what the rays of one scan say of the voxels.

use super::voxel_state::{VoxelRecord, VoxelState};
use crate::geometry::{Pose, Scan, Vec3};
use crate::voxel::{BlockGrid, SlotSet};
use nalgebra::{Point3, Rotation3};
use rayon::prelude::*;

/// A ray says that a voxel holds no surface only if it leaves the voxel at least this many voxel
/// edges before its end: nearer, noise and the discretisation cannot be told from a surface.
const MIN_CLEARANCE_VOXELS: f64 = 1.0;
/// Rays in a batch; each batch has its own sets.
const BATCH_RAYS: usize = 16_384;
/// Bits that number the eighths of a voxel.
const OCTANT_BITS: u32 = 3;

/// What one scan says of the voxels.
pub(crate) struct ScanEvidence {
    /// Voxels with points, ascending.
    pub hits: Vec<VoxelHits>,
    /// The slots of `hits`.
    pub hit: SlotSet,
    /// Voxels that a ray went through before its end.
    pub traversed: SlotSet,
    /// Of those, the ones well before the end of a ray.
    pub passed: SlotSet,
    /// Voxels behind the end of a ray.
    pub occluded: SlotSet,
}

/// A voxel and the number of points of a scan in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct VoxelHits {
    pub slot: u32,
    pub points: u32,
}

/// A measured ray, object frame.
struct Ray {
    origin: Vec3,
    direction: Vec3,
    length: f64,
}

/// The end of a ray.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct RayEnd {
    /// The eighth of a voxel in which it lies: eight times the voxel's slot, plus the octant.
    octant: u64,
    /// Index of the point in its scan.
    point: u32,
}

impl RayEnd {
    fn slot(&self) -> u32 {
        (self.octant >> OCTANT_BITS) as u32
    }
}

/// The voxels that rays cross.
struct CrossedVoxels {
    traversed: SlotSet,
    passed: SlotSet,
    occluded: SlotSet,
}

impl CrossedVoxels {
    fn new(slots: usize) -> CrossedVoxels {
        CrossedVoxels {
            traversed: SlotSet::new(slots),
            passed: SlotSet::new(slots),
            occluded: SlotSet::new(slots),
        }
    }

    fn unite(mut self, other: CrossedVoxels) -> CrossedVoxels {
        self.traversed.unite(&other.traversed);
        self.passed.unite(&other.passed);
        self.occluded.unite(&other.occluded);
        self
    }

    /// Adds the voxels along a ray. It does not end at its point: what lies behind is occluded.
    fn add_ray(&mut self, grid: &BlockGrid<VoxelRecord>, ray: &Ray) {
        let clear = clear_length(grid, ray);
        for step in grid.walk_ray(&ray.origin, &ray.direction, 0.0, f64::INFINITY) {
            if step.leave <= ray.length {
                self.traversed.insert(step.slot);
                if step.leave <= clear {
                    self.passed.insert(step.slot);
                }
            } else if step.enter > ray.length {
                self.occluded.insert(step.slot);
            }
        }
    }
}

/// Carves the scan from `pose` (`object_from_sensor`). Points with fewer than `min_support` of the
/// scan in their voxel and the 26 around it are left out as outliers.
pub(crate) fn carve(
    grid: &BlockGrid<VoxelRecord>,
    scan: &Scan,
    pose: &Pose,
    min_support: usize,
) -> ScanEvidence {
    let mut ends = ray_ends(grid, scan, pose);
    let all: Vec<VoxelHits> = ends
        .chunk_by(|a, b| a.slot() == b.slot())
        .map(|group| VoxelHits { slot: group[0].slot(), points: group.len() as u32 })
        .collect();
    let mut hit = SlotSet::new(grid.slots());
    let mut hits = all.clone();
    hits.retain(|voxel| is_supported(grid, &all, *voxel, min_support));
    for voxel in &hits {
        hit.insert(voxel.slot);
    }
    // One ray for each eighth of a voxel: the others in it carve the same voxels.
    ends.dedup_by_key(|end| end.octant);
    ends.retain(|end| hit.contains(end.slot()));
    let crossed = ends
        .par_chunks(BATCH_RAYS)
        .map(|batch| cross_voxels(grid, scan, pose, batch))
        .reduce(|| CrossedVoxels::new(grid.slots()), CrossedVoxels::unite);
    let CrossedVoxels { traversed, passed, occluded } = crossed;
    ScanEvidence { hits, hit, traversed, passed, occluded }
}

/// Adds what the rays of `beyond` say, which ended beyond the object: the space before their ends
/// is free.
pub(crate) fn carve_beyond(
    grid: &BlockGrid<VoxelRecord>,
    beyond: &Scan,
    pose: &Pose,
    evidence: &mut ScanEvidence,
) {
    let indices: Vec<usize> = beyond.returns().collect();
    let free = indices
        .par_chunks(BATCH_RAYS)
        .map(|batch| free_voxels(grid, beyond, pose, batch))
        .reduce(|| SlotSet::new(grid.slots()), united);
    evidence.traversed.unite(&free);
    evidence.passed.unite(&free);
}

fn united(mut a: SlotSet, b: SlotSet) -> SlotSet {
    a.unite(&b);
    a
}

fn cross_voxels(
    grid: &BlockGrid<VoxelRecord>,
    scan: &Scan,
    pose: &Pose,
    ends: &[RayEnd],
) -> CrossedVoxels {
    let mut crossed = CrossedVoxels::new(grid.slots());
    for ray in ends.iter().filter_map(|end| measured_ray(scan, pose, end.point as usize)) {
        crossed.add_ray(grid, &ray);
    }
    crossed
}

/// The voxels well before the ends of the rays. The end itself is the surface of another body.
fn free_voxels(
    grid: &BlockGrid<VoxelRecord>,
    scan: &Scan,
    pose: &Pose,
    indices: &[usize],
) -> SlotSet {
    let mut free = SlotSet::new(grid.slots());
    for ray in indices.iter().filter_map(|&index| measured_ray(scan, pose, index)) {
        let clear = clear_length(grid, &ray);
        for step in grid.walk_ray(&ray.origin, &ray.direction, 0.0, clear.max(0.0)) {
            if step.leave <= clear {
                free.insert(step.slot);
            }
        }
    }
    free
}

/// The length of a ray up to which it says that voxels hold no surface, metres.
fn clear_length(grid: &BlockGrid<VoxelRecord>, ray: &Ray) -> f64 {
    ray.length - MIN_CLEARANCE_VOXELS * grid.edge()
}

/// Whether a voxel and the 26 around it hold at least `min_support` points; `all` is ascending.
fn is_supported(
    grid: &BlockGrid<VoxelRecord>,
    all: &[VoxelHits],
    voxel: VoxelHits,
    min_support: usize,
) -> bool {
    voxel.points as usize >= min_support
        || grid.cube_around(voxel.slot).map(|slot| points_in(all, slot)).sum::<usize>()
            >= min_support
}

fn points_in(all: &[VoxelHits], slot: u32) -> usize {
    let found = all.binary_search_by_key(&slot, |voxel| voxel.slot);
    found.map_or(0, |at| all[at].points as usize)
}

/// The end of each ray, sorted; points outside the grid or in solid space are left out.
fn ray_ends(grid: &BlockGrid<VoxelRecord>, scan: &Scan, pose: &Pose) -> Vec<RayEnd> {
    let matrix = pose.rotation.to_rotation_matrix();
    let points = scan.points.par_iter().enumerate();
    let mut ends: Vec<RayEnd> = points
        .filter_map(|(index, point)| {
            let point = to_object(&matrix, &pose.translation.vector, point);
            Some(RayEnd { octant: octant_at(grid, &point)?, point: index as u32 })
        })
        .collect();
    ends.par_sort_unstable();
    ends
}

fn to_object(rotation: &Rotation3<f64>, translation: &Vec3, point: &[f32; 3]) -> Vec3 {
    let point = Vec3::new(point[0].into(), point[1].into(), point[2].into());
    rotation * point + translation
}

/// The eighth of a voxel in which `point` lies, as [`RayEnd::octant`]; `None` outside the grid or
/// in solid space.
fn octant_at(grid: &BlockGrid<VoxelRecord>, point: &Vec3) -> Option<u64> {
    let slot = point.iter().all(|v| v.is_finite()).then(|| grid.slot_at(point))??;
    if grid.get(slot).state == VoxelState::Excluded {
        return None;
    }
    let mut octant = u64::from(slot) << OCTANT_BITS;
    for axis in 0..3 {
        octant |= u64::from((point[axis] / grid.edge()).rem_euclid(1.0) >= 0.5) << axis;
    }
    Some(octant)
}

/// The ray to point `index` of a scan from `pose`; `None` without a return or without a length.
fn measured_ray(scan: &Scan, pose: &Pose, index: usize) -> Option<Ray> {
    let origin = pose.transform_point(&Point3::from(scan.origin(index))).coords;
    let end = pose.transform_point(&Point3::from(scan.point(index)?)).coords;
    let length = (end - origin).norm();
    (length > 0.0).then(|| Ray { origin, direction: (end - origin) / length, length })
}

#[cfg(test)]
#[path = "carving_tests.rs"]
mod tests;
