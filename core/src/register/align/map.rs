//! The map that scans are aligned to.
//!
//! A scan that shows known surface adds no point and costs a look-up in a hash map. New points have
//! the search tree built anew: over a hundred scans that is about twice as fast as a forest of
//! trees (Bentley & Saxe 1980), whose newer trees hold scattered points and make every search
//! longer.

use crate::geometry::{KdTree, Pose, Vec3, transform};
use crate::voxel::{Voxel, voxel_of};
use rustc_hash::FxHashMap;

/// Oriented points in the object frame that scans are aligned to: at most one a voxel and side of
/// the surface, so that the map grows with the surface, not with the number of scans. Each is the
/// mean of what the scans had measured there when the tree was built: with less noise there are
/// fewer local minima.
pub(crate) struct Map {
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
    /// Sums of which the points are the means.
    sums: Vec<VoxelSum>,
    /// Whether the point lies at the border of all scans that saw its voxel.
    boundary: Vec<bool>,
    /// Edge of the voxels, metres.
    voxel: f64,
    /// Index of the point of each voxel and side.
    indices: FxHashMap<(Voxel, usize), u32>,
    tree: KdTree,
}

/// A surface that is added to the map, sensor frame.
#[derive(Clone, Copy)]
pub(crate) struct MapSurface<'a> {
    /// Metres.
    pub points: &'a [Vec3],
    /// Unit normals.
    pub normals: &'a [Vec3],
    /// Whether each point lies at the border of the scan; empty if none does.
    pub boundary: &'a [bool],
}

/// Sums over the measurements of one side of the surface in a voxel.
struct VoxelSum {
    point: Vec3,
    normal: Vec3,
    count: f64,
}

/// A point of the map, object frame.
#[derive(Clone, Copy)]
pub(crate) struct MapPoint {
    /// Metres.
    pub point: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// Whether it lies at the border of all scans that saw it.
    pub boundary: bool,
}

impl Map {
    /// An empty map with one point a voxel of edge `voxel` (metres).
    pub(crate) fn new(voxel: f64) -> Map {
        Map {
            points: Vec::new(),
            normals: Vec::new(),
            sums: Vec::new(),
            boundary: Vec::new(),
            voxel,
            indices: FxHashMap::default(),
            tree: KdTree::new(&[]),
        }
    }

    /// Edge of the voxels, metres.
    pub(crate) fn voxel(&self) -> f64 {
        self.voxel
    }

    /// The map of surfaces (sensor frame), each with its pose `object_from_sensor`; the tree is
    /// built once.
    pub(crate) fn from_surfaces<'a>(
        surfaces: impl Iterator<Item = (MapSurface<'a>, &'a Pose)>,
        voxel: f64,
    ) -> Map {
        let mut map = Map::new(voxel);
        for (surface, pose) in surfaces {
            map.accumulate(&surface, pose);
        }
        map.rebuild_tree();
        map
    }

    /// Adds a surface (sensor frame) with its pose `object_from_sensor`. Returns how many points
    /// were built into the tree: 0 if no voxel is new.
    pub(crate) fn insert(&mut self, surface: &MapSurface, pose: &Pose) -> usize {
        self.accumulate(surface, pose);
        if self.sums.len() == self.points.len() {
            return 0;
        }
        self.rebuild_tree();
        self.points.len()
    }

    fn rebuild_tree(&mut self) {
        self.points = self.sums.iter().map(|sum| sum.point / sum.count).collect();
        // The normals of one side of a cube do not cancel.
        self.normals = self.sums.iter().map(|sum| sum.normal.normalize()).collect();
        self.tree = KdTree::new(&self.points);
    }

    /// Adds the points to the sums; the tree is rebuilt later.
    fn accumulate(&mut self, surface: &MapSurface, pose: &Pose) {
        for (i, (p, n)) in surface.points.iter().zip(surface.normals).enumerate() {
            let (point, normal) = (transform(pose, p), pose.rotation * n);
            let boundary = surface.boundary.get(i).copied().unwrap_or(false);
            // The six sides of a cube are enough to keep the faces of a thin wall apart.
            let side = 2 * normal.iamax() + usize::from(normal[normal.iamax()] > 0.0);
            let next = self.sums.len() as u32;
            let key = (voxel_of(&point, self.voxel), side);
            let index = *self.indices.entry(key).or_insert(next);
            if index == next {
                self.sums.push(VoxelSum { point, normal, count: 1.0 });
                self.boundary.push(boundary);
            } else {
                let sum = &mut self.sums[index as usize];
                sum.point += point;
                sum.normal += normal;
                sum.count += 1.0;
                self.boundary[index as usize] &= boundary;
            }
        }
    }

    /// The nearest point within `radius` (metres) of `query` (object frame).
    pub(crate) fn nearest_within(&self, query: &Vec3, radius: f64) -> Option<MapPoint> {
        self.nearest(query).filter(|(_, distance)| *distance <= radius).map(|(target, _)| target)
    }

    /// The nearest point to `query` (object frame) and its distance, metres.
    pub(crate) fn nearest(&self, query: &Vec3) -> Option<(MapPoint, f64)> {
        let (i, square) = self.tree.nearest(query)?;
        let (point, normal, boundary) = (self.points[i], self.normals[i], self.boundary[i]);
        Some((MapPoint { point, normal, boundary }, square.sqrt()))
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
        (0..count).map(|_| sphere_point(&mut rng)).unzip()
    }

    fn sphere_point(rng: &mut ChaCha8Rng) -> (Vec3, Vec3) {
        let z: f64 = rng.random_range(-1.0..1.0);
        let angle: f64 = rng.random_range(0.0..std::f64::consts::TAU);
        let flat = (1.0 - z * z).sqrt();
        let normal = Vec3::new(flat * angle.cos(), flat * angle.sin(), z);
        (normal * rng.random_range(0.995..1.005), normal)
    }

    fn add(map: &mut Map, seed: u64, count: usize) -> usize {
        let (points, normals) = sphere(seed, count);
        map.insert(
            &MapSurface { points: &points, normals: &normals, boundary: &[] },
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
        let (border, inner) = ([true; 50], [false; 50]);
        let at_border = MapSurface { points: &points, normals: &normals, boundary: &border };
        let whole = MapSurface { boundary: &inner, ..at_border };
        map.insert(&at_border, &Pose::identity());
        assert!(map.nearest_within(&points[7], 0.1).unwrap().boundary);
        map.insert(&whole, &Pose::identity());
        map.insert(&at_border, &Pose::identity());
        assert!(!map.nearest_within(&points[7], 0.1).unwrap().boundary);
    }
}
