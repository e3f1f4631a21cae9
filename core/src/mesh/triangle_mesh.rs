//! The indexed triangle mesh.

use crate::geometry::{Aabb, Pose, Vec3, transform};

/// An indexed triangle mesh. Triangles are counter-clockwise seen from outside.
///
/// `normals`, `sigma` and `observed` are either empty or as long as `vertices`.
///
/// ```
/// use puffer_core::geometry::Vec3;
/// use puffer_core::mesh::{Mesh, genus, is_closed, is_oriented, self_intersections};
///
/// let corners = vec![Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::z()];
/// let mesh = Mesh::new(corners, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]);
/// assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-12);
/// assert!(is_closed(&mesh) && is_oriented(&mesh));
/// assert_eq!(genus(&mesh), Some(0));
/// assert!(self_intersections(&mesh).is_empty());
/// ```
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
    /// Whether a sensor observed each vertex.
    pub observed: Vec<bool>,
}

impl Mesh {
    /// A mesh without attributes.
    pub fn new(vertices: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Mesh {
        Mesh { vertices, triangles, ..Mesh::default() }
    }

    /// The corner positions of triangle `index`, metres.
    pub fn corners(&self, index: usize) -> [Vec3; 3] {
        self.triangles[index].map(|v| self.vertices[v as usize])
    }

    /// The bounding box.
    pub fn aabb(&self) -> Aabb {
        Aabb::from_points(&self.vertices)
    }

    /// Surface area, square metres.
    pub fn area(&self) -> f64 {
        (0..self.triangles.len()).map(|i| self.doubled_area_vector(i).norm() / 2.0).sum()
    }

    /// Enclosed volume of a closed mesh, cubic metres; negative if it is oriented inwards.
    pub fn volume(&self) -> f64 {
        (0..self.triangles.len()).map(|i| signed_volume(&self.corners(i))).sum()
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

    /// The mesh in another frame, with its attributes.
    pub fn transformed(&self, target_from_mesh: &Pose) -> Mesh {
        let mut mesh = self.clone();
        for vertex in &mut mesh.vertices {
            *vertex = transform(target_from_mesh, vertex);
        }
        for normal in &mut mesh.normals {
            *normal = target_from_mesh.rotation * *normal;
        }
        mesh
    }

    /// Normal of triangle `index` whose length is twice the triangle's area.
    fn doubled_area_vector(&self, index: usize) -> Vec3 {
        let [a, b, c] = self.corners(index);
        (b - a).cross(&(c - a))
    }
}

/// Signed volume of the tetrahedron of a triangle and the origin: a sixth of the triple product.
fn signed_volume([a, b, c]: &[Vec3; 3]) -> f64 {
    a.dot(&b.cross(c)) / 6.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Twist, exp};
    use crate::mesh::test_shapes::{cuboid, sphere};

    #[test]
    fn a_box_has_the_area_and_volume_of_its_edges() {
        let mesh = cuboid(Vec3::new(1.0, 1.0, 1.0), Vec3::new(2.0, 3.0, 4.0));
        assert!((mesh.area() - 2.0 * (2.0 + 3.0 + 6.0)).abs() < 1e-12);
        assert!((mesh.volume() - 6.0).abs() < 1e-12);
        assert_eq!(mesh.aabb().extent(), Vec3::new(1.0, 2.0, 3.0));
        let mut inwards = mesh.clone();
        inwards.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        assert!((inwards.volume() + 6.0).abs() < 1e-12);
    }

    #[test]
    fn normals_of_a_sphere_are_radial_and_turn_with_it() {
        let mut mesh = sphere(0.5, 3);
        mesh.compute_normals();
        for (normal, vertex) in mesh.normals.iter().zip(&mesh.vertices) {
            assert!((normal - vertex.normalize()).norm() < 0.02);
        }
        let pose = exp(&Twist::new(0.1, -0.2, 0.3, 0.4, 0.5, -0.6));
        let moved = mesh.transformed(&pose);
        assert!((moved.volume() - mesh.volume()).abs() < 1e-12);
        let mut computed = moved.clone();
        computed.compute_normals();
        for (a, b) in moved.normals.iter().zip(&computed.normals) {
            assert!((a - b).norm() < 1e-9);
        }
    }

    #[test]
    fn a_degenerate_triangle_has_no_normal() {
        let mesh = Mesh::new(vec![Vec3::x(), Vec3::x() * 2.0, Vec3::x() * 3.0], vec![[0, 1, 2]]);
        assert_eq!(mesh.triangle_normal(0), Vec3::zeros());
        assert_eq!(mesh.area(), 0.0);
    }
}
