//! Triangle meshes: the plain indexed mesh, and what is known of it.

mod box_tree;
mod cluster;
mod half_edge;
pub mod intersect;
pub mod invariants;
pub mod io;
pub mod isosurface;
pub mod neighbours;
pub mod remesh;
pub mod render;
#[cfg(test)]
pub(crate) mod test_shapes;
mod triangle;

pub use cluster::clustered;
pub use half_edge::HalfEdgeMesh;
pub use intersect::{self_intersections, self_intersections_among};
pub use invariants::{
    components, degenerate_triangles, euler_characteristic, genus, is_closed, is_oriented,
    is_two_manifold, min_angles,
};
pub use triangle::{triangle_angles, triangles_intersect};

use crate::geometry::{Aabb, Pose, Vec3};

/// An indexed triangle mesh. Triangles are counter-clockwise seen from outside.
///
/// `normals`, `sigma` and `observed` are either empty or as long as `vertices`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions, metres.
    pub vertices: Vec<Vec3>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Outward unit normal of each vertex.
    pub normals: Vec<Vec3>,
    /// Standard deviation of each vertex along its normal, metres; NaN where nothing was measured.
    pub sigma: Vec<f64>,
    /// Whether each vertex was seen by a sensor.
    pub observed: Vec<bool>,
}

impl Mesh {
    /// A mesh without attributes.
    pub fn new(vertices: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Mesh {
        Mesh { vertices, triangles, ..Mesh::default() }
    }

    /// The corners of triangle `index`.
    pub fn corners(&self, index: usize) -> [Vec3; 3] {
        self.triangles[index].map(|v| self.vertices[v as usize])
    }

    /// The bounding box.
    pub fn aabb(&self) -> Aabb {
        Aabb::of(&self.vertices)
    }

    /// Surface area, square metres.
    pub fn area(&self) -> f64 {
        (0..self.triangles.len()).map(|i| self.doubled_area_vector(i).norm() / 2.0).sum()
    }

    /// Enclosed volume of a closed mesh, cubic metres; negative if it is oriented inwards.
    pub fn volume(&self) -> f64 {
        let volume = |i| {
            let [a, b, c] = self.corners(i);
            a.dot(&b.cross(&c)) / 6.0
        };
        (0..self.triangles.len()).map(volume).sum()
    }

    /// Unit normal of triangle `index`; zero if it is degenerate.
    pub fn triangle_normal(&self, index: usize) -> Vec3 {
        self.doubled_area_vector(index).try_normalize(0.0).unwrap_or_else(Vec3::zeros)
    }

    /// Recomputes `normals` as the area-weighted mean of the adjacent triangles' normals.
    pub fn compute_normals(&mut self) {
        let mut normals = vec![Vec3::zeros(); self.vertices.len()];
        for (i, triangle) in self.triangles.iter().enumerate() {
            let area_vector = self.doubled_area_vector(i);
            for &v in triangle {
                normals[v as usize] += area_vector;
            }
        }
        self.normals =
            normals.into_iter().map(|n| n.try_normalize(0.0).unwrap_or_else(Vec3::z)).collect();
    }

    /// The mesh in another frame.
    pub fn transformed(&self, target_from_mesh: &Pose) -> Mesh {
        let mut mesh = self.clone();
        for vertex in &mut mesh.vertices {
            *vertex = target_from_mesh.rotation * *vertex + target_from_mesh.translation.vector;
        }
        for normal in &mut mesh.normals {
            *normal = target_from_mesh.rotation * *normal;
        }
        mesh
    }

    fn doubled_area_vector(&self, index: usize) -> Vec3 {
        let [a, b, c] = self.corners(index);
        (b - a).cross(&(c - a))
    }
}
