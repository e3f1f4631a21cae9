//! The map that scans are aligned to.
//!
//! Nearest points are found in a forest of k-d trees, the logarithmic method of Bentley & Saxe 1980 (Decomposable
//! Searching Problems I): new points become a tree of their own, which swallows those before it that are not much
//! larger. So the trees' sizes fall geometrically, a search visits few of them, and each point is built into a new tree
//! at most about log2(points) times, however many scans come. What a scan shows of known surface adds no point and
//! costs a look into a hash set.

use crate::geometry::{KdTree, Pose, Vec3};
use crate::voxel::{Voxel, voxel_of};
use rustc_hash::FxHashMap;

/// Oriented points in the object frame that scans are aligned to: at most one a voxel and side, so that the map
/// grows with the surface, not with the number of scans.
pub(crate) struct Map {
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
    /// Whether the point lies at the border of all scans that saw its voxel.
    boundary: Vec<bool>,
    voxel: f64,
    taken: FxHashMap<(Voxel, usize), u32>,
    /// Oldest and largest first.
    forest: Vec<Tree>,
}

/// A tree over the consecutive points of the map from `first` on.
struct Tree {
    first: usize,
    tree: KdTree,
}

/// A tree stays apart from newer ones while it has at least this many times their points.
const RATIO: usize = 2;

/// What scans are added to the map as: points with unit normals, sensor frame, and whether each lies at the scan's
/// border (empty: none does).
#[derive(Clone, Copy)]
pub(crate) struct Surface<'a> {
    pub points: &'a [Vec3],
    pub normals: &'a [Vec3],
    pub boundary: &'a [bool],
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
            boundary: Vec::new(),
            voxel,
            taken: FxHashMap::default(),
            forest: Vec::new(),
        }
    }

    /// Edge of the voxels, metres.
    pub(crate) fn voxel(&self) -> f64 {
        self.voxel
    }

    /// Adds oriented points (sensor frame) seen from `pose`. Returns how many points were built into trees: the cost.
    pub(crate) fn insert(&mut self, surface: &Surface, pose: &Pose) -> usize {
        let known = self.points.len();
        for (i, (p, n)) in surface.points.iter().zip(surface.normals).enumerate() {
            let (point, normal) = (pose.rotation * p + pose.translation.vector, pose.rotation * n);
            let boundary = surface.boundary.get(i).copied().unwrap_or(false);
            // The six sides of a cube are enough to keep the faces of a thin wall apart.
            let side = 2 * normal.iamax() + usize::from(normal[normal.iamax()] > 0.0);
            let next = self.points.len() as u32;
            let index = *self.taken.entry((voxel_of(&point, self.voxel), side)).or_insert(next);
            if index == next {
                self.points.push(point);
                self.normals.push(normal);
                self.boundary.push(boundary);
            } else {
                self.boundary[index as usize] &= boundary;
            }
        }
        self.plant(known)
    }

    /// Puts the points from `first` on into trees.
    fn plant(&mut self, mut first: usize) -> usize {
        let end = self.points.len();
        if first == end {
            return 0;
        }
        while let Some(last) = self.forest.pop_if(|t| t.tree.len() < RATIO * (end - first)) {
            first = last.first;
        }
        self.forest.push(Tree { first, tree: KdTree::new(&self.points[first..]) });
        end - first
    }

    /// The nearest point within `radius` (metres) of `query` (object frame); of equally near ones, one of the oldest.
    pub(crate) fn nearest_within(&self, query: &Vec3, radius: f64) -> Option<Target> {
        let mut best: Option<(usize, f64)> = None;
        for Tree { first, tree } in &self.forest {
            if let Some((index, square)) = tree.nearest(query)
                && best.is_none_or(|(_, least)| square < least)
            {
                best = Some((first + index, square));
            }
        }
        let (i, _) = best.filter(|(_, square)| *square <= radius * radius)?;
        Some(Target { point: self.points[i], normal: self.normals[i], boundary: self.boundary[i] })
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
        let mut most_trees = 0;
        for scan in 0..12 {
            add(&mut map, scan, 700);
            most_trees = most_trees.max(map.forest.len());
            for query in sphere(100 + scan, 60).0.iter().map(|p| p * 1.02) {
                let brute = map.points.iter().map(|p| (p - query).norm()).fold(1.0, f64::min);
                for radius in [0.5 * brute, 1.001 * brute, 0.5] {
                    let found =
                        map.nearest_within(&query, radius).map(|t| (t.point - query).norm());
                    assert_eq!(found, (brute <= radius).then_some(brute));
                }
            }
        }
        assert!(most_trees > 1, "the search over several trees was not tried");
    }

    #[test]
    fn a_scan_of_known_surface_costs_no_more_the_more_scans_there_are() {
        let mut map = Map::new(0.1);
        let built: Vec<usize> = (0..100).map(|scan| add(&mut map, scan, 2000)).collect();
        let size = map.points.len();
        let log = size.ilog2() as usize + 1;
        assert!(built.iter().sum::<usize>() <= size * log, "{built:?} for {size} points");
        // The last fifty together cost less than the first alone.
        assert!(built[50..].iter().sum::<usize>() < built[0], "{built:?}");
        assert!(map.forest.len() <= log);
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
