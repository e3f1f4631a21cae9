//! A surface to measure against: nearest points on it, their normals, and whether they lie on a
//! boundary.

use crate::Result;
use crate::geometry::{Surface, Vec3};
use crate::mesh::Mesh;
use crate::mesh::invariants::{boundary_sides, degenerate_triangles};
use rayon::prelude::*;

/// Two points are equal if they are nearer than this share of the mesh's diagonal: far above
/// rounding, far below the resolution of any sensor.
const EQUAL_POINT_RATIO: f64 = 1e-9;

/// A mesh prepared for nearest-point queries.
pub struct ReferenceSurface {
    surface: Surface,
    /// Corners and unit normal of each triangle of `surface`.
    triangles: Vec<([Vec3; 3], Vec3)>,
    /// Which sides (bits 0 to 2: from corner k to k + 1) and corners (bits 3 to 5) of each triangle
    /// lie on the boundary.
    boundary_mask: Vec<u8>,
    /// Length below which two points count as equal, metres.
    tolerance: f64,
}

/// The point of a [`ReferenceSurface`] nearest to a query.
#[derive(Clone, Copy, Debug)]
pub struct NearestPoint {
    /// The nearest point, metres.
    pub point: Vec3,
    /// Its distance to the query, metres.
    pub distance: f64,
    /// Unit normal of the triangle that it lies on.
    pub normal: Vec3,
    /// Whether it lies on a boundary edge, that is one that only one triangle has.
    pub on_boundary: bool,
}

impl ReferenceSurface {
    /// Prepares `mesh` (metres); triangles without area are left out.
    ///
    /// # Errors
    /// [`crate::Error::Input`] if no triangle has an area.
    pub fn new(mesh: &Mesh) -> Result<ReferenceSurface> {
        let mut keep = vec![true; mesh.triangles.len()];
        for i in degenerate_triangles(mesh) {
            keep[i as usize] = false;
        }
        let mut side_mask = vec![0u8; mesh.triangles.len()];
        let mut boundary_vertex = vec![false; mesh.vertices.len()];
        for (t, k) in boundary_sides(mesh) {
            let (t, k) = (t as usize, k as usize);
            side_mask[t] |= 1 << k;
            boundary_vertex[mesh.triangles[t][k] as usize] = true;
            boundary_vertex[mesh.triangles[t][(k + 1) % 3] as usize] = true;
        }
        let kept: Vec<usize> = (0..keep.len()).filter(|&i| keep[i]).collect();
        let indices: Vec<[u32; 3]> = kept.iter().map(|&i| mesh.triangles[i]).collect();
        let masks = kept.iter().map(|&i| {
            let corners = mesh.triangles[i].map(|v| u8::from(boundary_vertex[v as usize]));
            side_mask[i] | corners[0] << 3 | corners[1] << 4 | corners[2] << 5
        });
        Ok(ReferenceSurface {
            surface: Surface::new(&mesh.vertices, &indices)?,
            triangles: kept.iter().map(|&i| (mesh.corners(i), mesh.triangle_normal(i))).collect(),
            boundary_mask: masks.collect(),
            tolerance: EQUAL_POINT_RATIO * mesh.aabb().diagonal(),
        })
    }

    /// The point of the surface nearest to `query` (metres).
    pub fn nearest(&self, query: &Vec3) -> NearestPoint {
        let found = self.surface.project(query);
        NearestPoint {
            point: found.point,
            distance: found.distance,
            normal: self.triangles[found.triangle].1,
            on_boundary: self.lies_on_boundary(&found.point, found.triangle),
        }
    }

    /// The nearest points to all `queries`, in their order, computed on all cores.
    pub fn nearest_all(&self, queries: &[Vec3]) -> Vec<NearestPoint> {
        queries.par_iter().map(|query| self.nearest(query)).collect()
    }

    /// Whether `point`, which lies on `triangle`, lies on a boundary edge or vertex of it.
    fn lies_on_boundary(&self, point: &Vec3, triangle: usize) -> bool {
        let (mask, corners) = (self.boundary_mask[triangle], &self.triangles[triangle].0);
        (0..3).any(|k| {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            let along = b - a;
            let t = ((point - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            (mask & (1 << k) != 0 && (a + along * t - point).norm() <= self.tolerance)
                || (mask & (8 << k) != 0 && (a - point).norm() <= self.tolerance)
        })
    }
}

/// Distances (metres) of those of `points` to an open surface whose nearest point is not on its
/// boundary.
///
/// A point whose nearest point is on the boundary has no counterpart on the surface and tells
/// nothing of the accuracy.
pub fn distances_to_open_truth(points: &[Vec3], truth: &ReferenceSurface) -> Vec<f64> {
    interior_distances(&truth.nearest_all(points))
}

/// The distances to nearest points that are not on a boundary.
pub(crate) fn interior_distances(nearest: &[NearestPoint]) -> Vec<f64> {
    nearest.iter().filter(|n| !n.on_boundary).map(|n| n.distance).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_shapes::{cuboid, torus};

    #[test]
    fn the_nearest_point_is_that_of_a_plain_search() {
        let mesh = torus(1.0, 0.4, 30, 15);
        let reference = ReferenceSurface::new(&mesh).unwrap();
        for i in 0..200 {
            let t = f64::from(i);
            let query = Vec3::new((t * 0.7).sin() * 1.5, (t * 1.1).cos() * 1.5, (t * 0.3).sin());
            let nearest = reference.nearest(&query);
            // Dense points on the triangles cannot be nearer, and come close.
            let mut best = f64::INFINITY;
            for j in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(j);
                for u in 0..=10 {
                    for v in 0..=10 - u {
                        let point =
                            a + (b - a) * f64::from(u) / 10.0 + (c - a) * f64::from(v) / 10.0;
                        best = best.min((point - query).norm());
                    }
                }
            }
            assert!(nearest.distance <= best + 1e-12 && nearest.distance > best - 0.01);
            assert!(!nearest.on_boundary);
        }
    }

    #[test]
    fn points_beyond_the_rim_of_an_open_box_are_not_covered() {
        let mut mesh = cuboid(Vec3::zeros(), Vec3::repeat(1.0));
        // The lid z = 1 goes.
        mesh.triangles.retain(|t| !t.iter().all(|v| *v >= 4));
        mesh.triangles.push([0, 0, 1]);
        let reference = ReferenceSurface::new(&mesh).unwrap();
        let points = [
            Vec3::new(0.5, 1.1, 1.2), // above the rim
            Vec3::new(1.1, 1.1, 1.2), // above a corner
            Vec3::new(0.5, 1.25, 0.5),
            Vec3::new(0.5, 0.5, -0.5),
        ];
        let flags: Vec<bool> = points.iter().map(|p| reference.nearest(p).on_boundary).collect();
        assert_eq!(flags, [true, true, false, false]);
        assert_eq!(distances_to_open_truth(&points, &reference), [0.25, 0.5]);
    }
}
