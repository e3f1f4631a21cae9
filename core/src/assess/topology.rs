//! Validity of a mesh (closed, two-manifold, oriented, ...) and the shape of its triangles.

use super::statistics::{quantile, share};
use crate::mesh::{self, Mesh};
use serde::Serialize;

/// The order statistic of `min_angle_p1`.
const LOWER_QUANTILE: f64 = 0.01;
/// Triangles whose smallest angle is above this are well shaped (the figure `min_angle_above_20`).
const MIN_GOOD_ANGLE_DEG: f64 = 20.0;

/// Properties of a mesh that need no truth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Topology {
    /// Number of vertices.
    pub vertices: usize,
    /// Number of triangles.
    pub triangles: usize,
    /// Whether no edge has only one triangle.
    pub closed: bool,
    /// Whether every edge has at most two triangles and the triangles of every vertex form one fan.
    pub two_manifold: bool,
    /// Whether adjacent triangles run along their shared edge in opposite directions.
    pub oriented: bool,
    /// Triangles that intersect another one outside a shared vertex or edge.
    pub self_intersecting_faces: usize,
    /// Number of handles of all components together; `None` unless the mesh is closed, two-manifold
    /// and oriented, because it is not defined then.
    pub genus: Option<i64>,
    /// Number of connected components.
    pub components: usize,
    /// Triangles without area.
    pub degenerate_faces: usize,
    /// Whether a closed mesh encloses a positive volume, so that its triangles face outwards;
    /// `None` of an open mesh.
    pub outward: Option<bool>,
    /// The angle below which the smallest angle of 1 % of the triangles lies, degrees.
    pub min_angle_p1: f64,
    /// Share of the triangles whose smallest angle is above 20 degrees.
    pub min_angle_above_20: f64,
}

/// Measures the properties of `mesh` that need no truth.
pub fn assess_topology(mesh: &Mesh) -> Topology {
    let mut intersecting: Vec<u32> =
        mesh::self_intersections(mesh).into_iter().flat_map(|(a, b)| [a, b]).collect();
    intersecting.sort_unstable();
    intersecting.dedup();
    let angles: Vec<f64> = mesh::min_angles(mesh).into_iter().map(f64::to_degrees).collect();
    let closed = mesh::is_closed(mesh);
    Topology {
        vertices: mesh.vertices.len(),
        triangles: mesh.triangles.len(),
        closed,
        two_manifold: mesh::is_two_manifold(mesh),
        oriented: mesh::is_oriented(mesh),
        self_intersecting_faces: intersecting.len(),
        genus: mesh::genus(mesh),
        components: mesh::components(mesh),
        degenerate_faces: mesh::degenerate_triangles(mesh).len(),
        outward: closed.then(|| mesh.volume() > 0.0),
        min_angle_p1: quantile(&angles, LOWER_QUANTILE),
        min_angle_above_20: share(&angles, |a| a > MIN_GOOD_ANGLE_DEG),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vec3;
    use crate::mesh::test_shapes::{cuboid, sphere, torus, union};

    #[test]
    fn shapes_have_their_counts_and_genus() {
        let pair = union(&torus(0.1, 0.02, 24, 12), &cuboid(Vec3::repeat(1.0), Vec3::repeat(2.0)));
        let found = assess_topology(&pair);
        assert_eq!((found.vertices, found.triangles), (24 * 12 + 8, 24 * 12 * 2 + 12));
        assert!(found.closed && found.two_manifold && found.oriented);
        assert_eq!((found.genus, found.components, found.outward), (Some(1), 2, Some(true)));
        assert_eq!((found.self_intersecting_faces, found.degenerate_faces), (0, 0));
    }

    #[test]
    fn a_mesh_that_faces_inwards_and_one_that_cuts_itself_are_told() {
        let mut inwards = sphere(0.1, 2);
        inwards.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        assert_eq!(assess_topology(&inwards).outward, Some(false));
        let unit = cuboid(Vec3::zeros(), Vec3::repeat(1.0));
        let cut = union(&unit, &cuboid(Vec3::repeat(0.5), Vec3::repeat(1.5)));
        let found = assess_topology(&cut);
        assert!(found.closed && found.self_intersecting_faces >= 12);
    }

    #[test]
    fn the_angles_of_a_box_are_those_of_its_faces() {
        let found = assess_topology(&cuboid(Vec3::zeros(), Vec3::new(1.0, 1.0, 10.0)));
        // Four of the twelve triangles are halves of squares.
        assert!((found.min_angle_p1 - 0.1f64.atan().to_degrees()).abs() < 1e-9);
        assert!((found.min_angle_above_20 - 4.0 / 12.0).abs() < 1e-12);
    }
}
