//! Invariants of a mesh: whether it is closed, two-manifold and oriented, its topology and its
//! smallest angles.

use super::Mesh;
use super::triangle::{are_collinear, triangle_angles};
use crate::geometry::Vec3;
use rayon::prelude::*;

/// One side of a triangle.
struct Side {
    /// Its end vertices, the smaller index first.
    edge: (u32, u32),
    /// The corner that it starts at: three times the triangle's index, plus 0 to 2.
    corner: u32,
    /// Whether it runs from the smaller to the larger vertex index.
    ascending: bool,
}

/// All sides, sorted by edge; sides of the same edge are in the order of their triangles.
fn sorted_sides(mesh: &Mesh) -> Vec<Side> {
    let mut sides: Vec<Side> = mesh
        .triangles
        .par_iter()
        .enumerate()
        .flat_map_iter(|(t, triangle)| {
            (0..3).map(move |k| {
                let (from, to) = (triangle[k], triangle[(k + 1) % 3]);
                let edge = (from.min(to), from.max(to));
                Side { edge, corner: (3 * t + k) as u32, ascending: from < to }
            })
        })
        .collect();
    sides.par_sort_unstable_by_key(|side| (side.edge, side.corner));
    sides
}

/// Groups sorted sides by their edge.
fn sides_by_edge(sides: &[Side]) -> impl Iterator<Item = &[Side]> {
    sides.chunk_by(|a, b| a.edge == b.edge)
}

/// Whether the mesh has triangles and no boundary edge, that is no edge with only one triangle.
pub fn is_closed(mesh: &Mesh) -> bool {
    !mesh.triangles.is_empty() && sides_by_edge(&sorted_sides(mesh)).all(|edge| edge.len() > 1)
}

/// Whether the mesh is a two-manifold, possibly with boundary: every edge has at most two
/// triangles, the triangles of every vertex form one fan, and no triangle has a vertex twice.
pub fn is_two_manifold(mesh: &Mesh) -> bool {
    let sides = sorted_sides(mesh);
    if sides.iter().any(|side| side.edge.0 == side.edge.1)
        || sides_by_edge(&sides).any(|e| e.len() > 2)
    {
        return false;
    }
    // Corners of one vertex whose triangles share an edge belong to the same fan.
    let mut fans = DisjointSets::new(3 * mesh.triangles.len());
    for edge in sides_by_edge(&sides) {
        if let [a, b] = edge {
            for vertex in [edge[0].edge.0, edge[0].edge.1] {
                fans.join(corner_at(mesh, a, vertex), corner_at(mesh, b, vertex));
            }
        }
    }
    let mut fan_of = vec![u32::MAX; mesh.vertices.len()];
    mesh.triangles.iter().flatten().enumerate().all(|(corner, &vertex)| {
        let fan = fans.root(corner as u32);
        let previous = std::mem::replace(&mut fan_of[vertex as usize], fan);
        previous == u32::MAX || previous == fan
    })
}

/// The corner of the side's triangle that lies at `vertex`, one of the side's ends.
fn corner_at(mesh: &Mesh, side: &Side, vertex: u32) -> u32 {
    let (triangle, k) = (side.corner / 3, side.corner % 3);
    if mesh.triangles[triangle as usize][k as usize] == vertex {
        side.corner
    } else {
        3 * triangle + (k + 1) % 3
    }
}

/// Whether the two triangles of every shared edge run along it in opposite directions. Edges with
/// more than two triangles must be run equally often in both directions.
pub fn is_oriented(mesh: &Mesh) -> bool {
    sides_by_edge(&sorted_sides(mesh)).all(|edge| {
        let ascending = edge.iter().filter(|side| side.ascending).count();
        edge.len() == 1 || 2 * ascending == edge.len()
    })
}

/// Number of components that are connected through shared vertices; vertices without a triangle do
/// not count.
pub fn components(mesh: &Mesh) -> usize {
    let mut parts = DisjointSets::new(mesh.vertices.len());
    for &[a, b, c] in &mesh.triangles {
        parts.join(a, b);
        parts.join(b, c);
    }
    let used = used_vertices(mesh);
    (0..used.len()).filter(|&v| used[v] && parts.root(v as u32) == v as u32).count()
}

/// Vertices minus edges plus triangles; vertices without a triangle do not count.
pub fn euler_characteristic(mesh: &Mesh) -> i64 {
    let vertices = used_vertices(mesh).iter().filter(|&&used| used).count();
    let edges = sides_by_edge(&sorted_sides(mesh)).count();
    vertices as i64 - edges as i64 + mesh.triangles.len() as i64
}

/// Genus: the number of handles, 1 - chi / 2 of each component, summed over all components. `None`
/// unless the mesh is closed, two-manifold and oriented, because it is not defined otherwise.
pub fn genus(mesh: &Mesh) -> Option<i64> {
    (is_closed(mesh) && is_two_manifold(mesh) && is_oriented(mesh))
        .then(|| components(mesh) as i64 - euler_characteristic(mesh) / 2)
}

/// The boundary edges, which only one triangle has, as (triangle, k) for the side from corner k to
/// corner k + 1; ascending.
pub fn boundary_sides(mesh: &Mesh) -> Vec<(u32, u32)> {
    let mut boundary: Vec<(u32, u32)> = sides_by_edge(&sorted_sides(mesh))
        .filter(|edge| edge.len() == 1)
        .map(|edge| (edge[0].corner / 3, edge[0].corner % 3))
        .collect();
    boundary.sort_unstable();
    boundary
}

/// The smallest angle of each triangle, radians; 0 for a degenerate one.
pub fn min_angles(mesh: &Mesh) -> Vec<f64> {
    let triangles = (0..mesh.triangles.len()).into_par_iter();
    triangles.map(|i| min_angle(&mesh.corners(i))).collect()
}

/// The smallest angle, radians; 0 for collinear corners.
fn min_angle(corners: &[Vec3; 3]) -> f64 {
    if are_collinear(corners) {
        return 0.0;
    }
    triangle_angles(corners).into_iter().fold(f64::INFINITY, f64::min)
}

/// Triangles without area: those that have a vertex twice or whose corners lie on one line;
/// ascending. The test is exact.
pub fn degenerate_triangles(mesh: &Mesh) -> Vec<u32> {
    (0..mesh.triangles.len())
        .into_par_iter()
        .filter(|&i| are_collinear(&mesh.corners(i)))
        .map(|i| i as u32)
        .collect()
}

/// Whether each vertex belongs to a triangle.
fn used_vertices(mesh: &Mesh) -> Vec<bool> {
    let mut used = vec![false; mesh.vertices.len()];
    for &v in mesh.triangles.iter().flatten() {
        used[v as usize] = true;
    }
    used
}

/// Disjoint sets (union-find with path halving); the root of each set is its smallest member.
struct DisjointSets(Vec<u32>);

impl DisjointSets {
    fn new(len: usize) -> DisjointSets {
        DisjointSets((0..len as u32).collect())
    }

    fn root(&mut self, mut member: u32) -> u32 {
        while self.0[member as usize] != member {
            let parent = self.0[member as usize];
            self.0[member as usize] = self.0[parent as usize];
            member = parent;
        }
        member
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_shapes::{cuboid, sphere, torus, union};
    use super::*;

    /// Whether the mesh is closed, two-manifold and oriented.
    fn validity(mesh: &Mesh) -> [bool; 3] {
        [is_closed(mesh), is_two_manifold(mesh), is_oriented(mesh)]
    }

    fn shifted(mesh: &Mesh, by: Vec3) -> Mesh {
        let mut mesh = mesh.clone();
        mesh.vertices.iter_mut().for_each(|v| *v += by);
        mesh
    }

    #[test]
    fn sphere_torus_and_both_together() {
        let ball = sphere(1.0, 2);
        let ring = torus(1.0, 0.3, 24, 12);
        let both = union(&shifted(&ball, Vec3::x() * 5.0), &ring);
        for (mesh, parts, chi, handles) in [(ball, 1, 2, 0), (ring, 1, 0, 1), (both, 2, 2, 1)] {
            assert_eq!(validity(&mesh), [true; 3]);
            assert_eq!(components(&mesh), parts);
            assert_eq!(euler_characteristic(&mesh), chi);
            assert_eq!(genus(&mesh), Some(handles));
            assert_eq!(boundary_sides(&mesh), []);
            assert!(degenerate_triangles(&mesh).is_empty());
            assert!(mesh.volume() > 0.0);
        }
    }

    #[test]
    fn an_open_mesh_is_manifold_but_not_closed() {
        let mut mesh = sphere(1.0, 2);
        mesh.triangles.remove(5);
        assert_eq!(validity(&mesh), [false, true, true]);
        assert_eq!(genus(&mesh), None);
        assert_eq!(boundary_sides(&mesh).len(), 3);
        assert_eq!(euler_characteristic(&mesh), 1);
        assert!(!is_closed(&Mesh::default()));
    }

    #[test]
    fn a_flipped_triangle_is_not_oriented() {
        let mut mesh = torus(1.0, 0.3, 24, 12);
        mesh.triangles[7].swap(0, 1);
        assert_eq!(validity(&mesh), [true, true, false]);
    }

    #[test]
    fn a_bow_tie_vertex_and_a_fin_are_not_manifold() {
        let unit = cuboid(Vec3::zeros(), Vec3::repeat(1.0));
        let mut tie = union(&unit, &cuboid(Vec3::repeat(1.0), Vec3::repeat(2.0)));
        tie.triangles.iter_mut().flatten().filter(|v| **v == 8).for_each(|v| *v = 7);
        assert_eq!(validity(&tie), [true, false, true]);
        assert_eq!(components(&tie), 1);
        let mut fin = unit.clone();
        fin.vertices.push(Vec3::repeat(-1.0));
        fin.triangles.push([0, 3, 8]);
        assert_eq!(validity(&fin), [false, false, false]);
    }

    #[test]
    fn degenerate_triangles_are_named_and_have_no_angle() {
        let mut mesh = cuboid(Vec3::zeros(), Vec3::repeat(1.0));
        mesh.vertices.push(Vec3::new(0.25, 0.0, 0.0));
        mesh.triangles.extend([[0, 8, 1], [2, 2, 3]]);
        assert_eq!(degenerate_triangles(&mesh), [12, 13]);
        let angles = min_angles(&mesh);
        assert!((angles[0].to_degrees() - 45.0).abs() < 1e-12);
        assert_eq!(angles[12..], [0.0, 0.0]);
        assert!(!is_two_manifold(&mesh));
    }
}
