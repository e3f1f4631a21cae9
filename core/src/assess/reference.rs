//! A surface to measure against: nearest points, their normals, and whether they lie on a boundary.

use crate::Result;
use crate::geometry::{Surface, Vec3};
use crate::mesh::Mesh;
use crate::mesh::invariants::{boundary_sides, degenerate_triangles};
use rayon::prelude::*;

/// A mesh prepared for nearest-point queries.
pub struct Reference {
    surface: Surface,
    /// Corners and unit normal of each triangle of `surface`.
    triangles: Vec<([Vec3; 3], Vec3)>,
    /// Which sides (bits 0 to 2: from corner k to k + 1) and corners (bits 3 to 5) of each lie on the boundary.
    on_boundary: Vec<u8>,
    /// Length below which two points are the same, metres.
    tolerance: f64,
}

/// The point of a [`Reference`] nearest to a query.
#[derive(Clone, Copy, Debug)]
pub struct Nearest {
    /// The nearest point, metres.
    pub point: Vec3,
    /// Its distance to the query, metres.
    pub distance: f64,
    /// Unit normal of the triangle that it lies on.
    pub normal: Vec3,
    /// Whether it lies on an edge that only one triangle has.
    pub on_boundary: bool,
}

impl Reference {
    /// Prepares `mesh`; triangles without area are left out.
    ///
    /// # Errors
    /// [`crate::Error::Input`] if no triangle has an area.
    pub fn new(mesh: &Mesh) -> Result<Reference> {
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
        let mask = |&i: &usize| {
            let corner = |k: usize| u8::from(boundary_vertex[mesh.triangles[i][k] as usize]);
            side_mask[i] | corner(0) << 3 | corner(1) << 4 | corner(2) << 5
        };
        Ok(Reference {
            surface: Surface::new(&mesh.vertices, &indices)?,
            triangles: kept.iter().map(|&i| (mesh.corners(i), mesh.triangle_normal(i))).collect(),
            on_boundary: kept.iter().map(mask).collect(),
            // Far above rounding, far below any sensor's resolution.
            tolerance: 1e-9 * mesh.aabb().diagonal(),
        })
    }

    /// The nearest point to `query`.
    pub fn nearest(&self, query: &Vec3) -> Nearest {
        let found = self.surface.project(query);
        Nearest {
            point: found.point,
            distance: found.distance,
            normal: self.triangles[found.triangle].1,
            on_boundary: self.lies_on_boundary(&found.point, found.triangle),
        }
    }

    /// The nearest points to all `queries`, in their order; on all cores.
    pub fn nearest_all(&self, queries: &[Vec3]) -> Vec<Nearest> {
        queries.par_iter().map(|query| self.nearest(query)).collect()
    }

    fn lies_on_boundary(&self, point: &Vec3, triangle: usize) -> bool {
        let (mask, corners) = (self.on_boundary[triangle], &self.triangles[triangle].0);
        (0..3).any(|k| {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            let along = b - a;
            let t = ((point - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            (mask & (1 << k) != 0 && (a + along * t - point).norm() <= self.tolerance)
                || (mask & (8 << k) != 0 && (a - point).norm() <= self.tolerance)
        })
    }
}

/// Distances (metres) from those of `points` to an open surface whose nearest point lies within it: a point that is
/// nearest to the surface's boundary has no counterpart there, and says nothing of accuracy.
pub fn distance_to_open_truth(points: &[Vec3], truth: &Reference) -> Vec<f64> {
    covered(&truth.nearest_all(points))
}

/// The distances to nearest points that are not on a boundary.
pub(crate) fn covered(nearest: &[Nearest]) -> Vec<f64> {
    nearest.iter().filter(|n| !n.on_boundary).map(|n| n.distance).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_shapes::{cuboid, torus};

    #[test]
    fn the_nearest_point_is_that_of_a_plain_search() {
        let mesh = torus(1.0, 0.4, 30, 15);
        let reference = Reference::new(&mesh).unwrap();
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
        let reference = Reference::new(&mesh).unwrap();
        let points = [
            Vec3::new(0.5, 1.1, 1.2), // above the rim
            Vec3::new(1.1, 1.1, 1.2), // above a corner
            Vec3::new(0.5, 1.25, 0.5),
            Vec3::new(0.5, 0.5, -0.5),
        ];
        let flags: Vec<bool> = points.iter().map(|p| reference.nearest(p).on_boundary).collect();
        assert_eq!(flags, [true, true, false, false]);
        assert_eq!(distance_to_open_truth(&points, &reference), [0.25, 0.5]);
    }
}
