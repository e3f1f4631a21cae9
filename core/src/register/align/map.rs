//! The map that scans are aligned to.
//!
//! What a scan shows of known surface adds no point and costs a look into a hash map. New points have the search tree
//! built anew: over a hundred scans about twice as fast as a forest of trees (Bentley & Saxe 1980), whose newer trees hold
//! scattered points and make every search longer.

use crate::geometry::{KdTree, Pose, Vec3};
use crate::voxel::{Voxel, voxel_of};
use rustc_hash::FxHashMap;

/// Oriented points in the object frame that scans are aligned to: at most one a voxel and side, so that the map
/// grows with the surface, not with the number of scans. It is the mean of what the scans saw there when the tree was
/// built: their noise makes fewer places where a scan may come to rest wrongly.
pub(crate) struct Map {
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
    seen: Vec<Seen>,
    /// Whether the point lies at the border of all scans that saw its voxel.
    boundary: Vec<bool>,
    voxel: f64,
    taken: FxHashMap<(Voxel, usize), u32>,
    tree: KdTree,
}

/// What scans are added to the map as: points with unit normals, sensor frame, and whether each lies at the scan's
/// border (empty: none does).
#[derive(Clone, Copy)]
pub(crate) struct Surface<'a> {
    pub points: &'a [Vec3],
    pub normals: &'a [Vec3],
    pub boundary: &'a [bool],
}

/// Sums over what was seen of a voxel's side.
struct Seen {
    point: Vec3,
    normal: Vec3,
    count: f64,
}

/// A point of the map.
#[derive(Clone, Copy)]
pub(crate) struct Target {
    pub point: Vec3,
    pub normal: Vec3,
    pub boundary: bool,
}

impl Map {
    /// An empty map with one point per voxel of edge `voxel` (metres).
    pub(crate) fn new(voxel: f64) -> Map {
        Map {
            points: Vec::new(),
            normals: Vec::new(),
            seen: Vec::new(),
            boundary: Vec::new(),
            voxel,
            taken: FxHashMap::default(),
            tree: KdTree::new(&[]),
        }
    }

    /// Edge of the voxels, metres.
    pub(crate) fn voxel(&self) -> f64 {
        self.voxel
    }

    /// The map of surfaces (sensor frame), each seen from its pose; the tree is built once.
    pub(crate) fn of<'a>(
        surfaces: impl Iterator<Item = (Surface<'a>, &'a Pose)>,
        voxel: f64,
    ) -> Map {
        let mut map = Map::new(voxel);
        for (surface, pose) in surfaces {
            map.take(&surface, pose);
        }
        map.build();
        map
    }

    /// Adds oriented points (sensor frame) seen from `pose`. Returns how many points were built into the tree.
    pub(crate) fn insert(&mut self, surface: &Surface, pose: &Pose) -> usize {
        self.take(surface, pose);
        if self.seen.len() == self.points.len() {
            return 0;
        }
        self.build();
        self.points.len()
    }

    fn build(&mut self) {
        self.points = self.seen.iter().map(|s| s.point / s.count).collect();
        // Of one side of a cube, normals do not cancel.
        self.normals = self.seen.iter().map(|s| s.normal.normalize()).collect();
        self.tree = KdTree::new(&self.points);
    }

    /// Adds points that the tree does not know yet.
    fn take(&mut self, surface: &Surface, pose: &Pose) {
        for (i, (p, n)) in surface.points.iter().zip(surface.normals).enumerate() {
            let (point, normal) = (pose.rotation * p + pose.translation.vector, pose.rotation * n);
            let boundary = surface.boundary.get(i).copied().unwrap_or(false);
            // The six sides of a cube are enough to keep the faces of a thin wall apart.
            let side = 2 * normal.iamax() + usize::from(normal[normal.iamax()] > 0.0);
            let next = self.seen.len() as u32;
            let index = *self.taken.entry((voxel_of(&point, self.voxel), side)).or_insert(next);
            if index == next {
                self.seen.push(Seen { point, normal, count: 1.0 });
                self.boundary.push(boundary);
            } else {
                let seen = &mut self.seen[index as usize];
                seen.point += point;
                seen.normal += normal;
                seen.count += 1.0;
                self.boundary[index as usize] &= boundary;
            }
        }
    }

    /// The nearest point within `radius` (metres) of `query` (object frame).
    pub(crate) fn nearest_within(&self, query: &Vec3, radius: f64) -> Option<Target> {
        self.nearest(query).filter(|(_, distance)| *distance <= radius).map(|(target, _)| target)
    }

    /// The nearest point to `query` (object frame) and its distance, metres.
    pub(crate) fn nearest(&self, query: &Vec3) -> Option<(Target, f64)> {
        let (i, square) = self.tree.nearest(query)?;
        let (point, normal, boundary) = (self.points[i], self.normals[i], self.boundary[i]);
        Some((Target { point, normal, boundary }, square.sqrt()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Points of a sphere of radius 1 m about the origin with a little noise, seen by scan `seed`.
    fn sphere(seed: u64, count: usize) -> (Vec<Vec3>, Vec<Vec3>) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut point = || {
            let z: f64 = rng.random_range(-1.0..1.0);
            let angle: f64 = rng.random_range(0.0..std::f64::consts::TAU);
            let flat = (1.0 - z * z).sqrt();
            let normal = Vec3::new(flat * angle.cos(), flat * angle.sin(), z);
            (normal * rng.random_range(0.995..1.005), normal)
        };
        (0..count).map(|_| point()).unzip()
    }

    fn add(map: &mut Map, seed: u64, count: usize) -> usize {
        let (points, normals) = sphere(seed, count);
        map.insert(
            &Surface { points: &points, normals: &normals, boundary: &[] },
            &Pose::identity(),
        )
    }

    #[test]
    fn the_nearest_is_that_of_brute_force_while_the_map_grows() {
        let mut map = Map::new(0.02);
        for scan in 0..12 {
            add(&mut map, scan, 700);
            for query in sphere(100 + scan, 60).0.iter().map(|p| p * 1.02) {
                let brute = map.points.iter().map(|p| (p - query).norm()).fold(1.0, f64::min);
                for radius in [0.5 * brute, 1.001 * brute, 0.5] {
                    let found =
                        map.nearest_within(&query, radius).map(|t| (t.point - query).norm());
                    assert_eq!(found, (brute <= radius).then_some(brute));
                }
            }
        }
    }

    #[test]
    fn the_map_grows_with_the_surface_not_with_the_scans() {
        let mut map = Map::new(0.1);
        for scan in 0..50 {
            add(&mut map, scan, 2000);
        }
        let size = map.points.len();
        assert_eq!(add(&mut map, 7, 2000), 0, "known surface had the tree built anew");
        for scan in 50..100 {
            add(&mut map, scan, 2000);
        }
        assert!(map.points.len() < size + size / 10, "{size} to {}", map.points.len());
    }

    #[test]
    fn a_place_that_some_scan_saw_whole_is_no_boundary() {
        let mut map = Map::new(0.1);
        let (points, normals) = sphere(1, 50);
        let insert = |map: &mut Map, border: bool| {
            let boundary = vec![border; 50];
            let surface = Surface { points: &points, normals: &normals, boundary: &boundary };
            map.insert(&surface, &Pose::identity())
        };
        insert(&mut map, true);
        assert!(map.nearest_within(&points[7], 0.1).unwrap().boundary);
        insert(&mut map, false);
        insert(&mut map, true);
        assert!(!map.nearest_within(&points[7], 0.1).unwrap().boundary);
    }
}
