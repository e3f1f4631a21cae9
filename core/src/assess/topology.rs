//! The gates that a mesh must pass, and the shape of its triangles.

use super::stats::{quantile, share};
use crate::mesh::{self, Mesh};
use serde::Serialize;

/// What holds of a mesh by itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Topology {
    /// Number of vertices.
    pub vertices: usize,
    /// Number of triangles.
    pub triangles: usize,
    /// No edge has only one triangle.
    pub closed: bool,
    /// Every edge has at most two triangles and every vertex one fan.
    pub two_manifold: bool,
    /// Every shared edge is run once in each direction.
    pub oriented: bool,
    /// Triangles that meet another one besides a common vertex or edge.
    pub self_intersecting_faces: usize,
    /// Handles of all components together; not defined unless closed, two-manifold and oriented.
    pub genus: Option<i64>,
    /// Connected parts.
    pub components: usize,
    /// Triangles without area.
    pub degenerate_faces: usize,
    /// Of a closed mesh: whether it encloses a positive volume, so that its triangles face outwards.
    pub outward: Option<bool>,
    /// 1 % of the triangles have a smallest angle below this, degrees.
    pub min_angle_p1: f64,
    /// Share of the triangles whose smallest angle is above 20 degrees.
    pub min_angle_above_20: f64,
}

/// Measures `mesh` by itself.
pub fn topology(mesh: &Mesh) -> Topology {
    let mut cut: Vec<u32> =
        mesh::self_intersections(mesh).into_iter().flat_map(|(a, b)| [a, b]).collect();
    cut.sort_unstable();
    cut.dedup();
    let angles: Vec<f64> = mesh::min_angles(mesh).into_iter().map(f64::to_degrees).collect();
    let closed = mesh::is_closed(mesh);
    Topology {
        vertices: mesh.vertices.len(),
        triangles: mesh.triangles.len(),
        closed,
        two_manifold: mesh::is_two_manifold(mesh),
        oriented: mesh::is_oriented(mesh),
        self_intersecting_faces: cut.len(),
        genus: mesh::genus(mesh),
        components: mesh::components(mesh),
        degenerate_faces: mesh::degenerate_triangles(mesh).len(),
        outward: closed.then(|| mesh.volume() > 0.0),
        min_angle_p1: quantile(&angles, 0.01),
        min_angle_above_20: share(&angles, |a| a > 20.0),
    }
}
