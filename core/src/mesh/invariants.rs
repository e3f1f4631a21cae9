//! What must hold of a mesh, as functions: closed, two-manifold, oriented, its topology and its angles.

use super::Mesh;
use super::triangle::{collinear, triangle_angles};
use rayon::prelude::*;

/// One side of a triangle: its end points (smaller index first), the corner that it starts at (three times the
/// triangle, plus 0 to 2), and whether it runs from the smaller to the larger index.
struct Side {
    edge: (u32, u32),
    corner: u32,
    ascending: bool,
}

/// All sides, sorted by edge; equal edges stand in the order of their triangles.
fn sides(mesh: &Mesh) -> Vec<Side> {
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

/// The sides of each edge.
fn by_edge(sides: &[Side]) -> impl Iterator<Item = &[Side]> {
    sides.chunk_by(|a, b| a.edge == b.edge)
}

/// Whether the mesh has triangles, and no edge that only one triangle has.
pub fn is_closed(mesh: &Mesh) -> bool {
    !mesh.triangles.is_empty() && by_edge(&sides(mesh)).all(|edge| edge.len() > 1)
}

/// Whether every edge has at most two triangles, the triangles of every vertex form one fan, and no triangle
/// names a vertex twice. A boundary is allowed.
pub fn is_two_manifold(mesh: &Mesh) -> bool {
    let sides = sides(mesh);
    if sides.iter().any(|side| side.edge.0 == side.edge.1) || by_edge(&sides).any(|e| e.len() > 2) {
        return false;
    }
    // Corners of one vertex that meet at an edge belong to one fan.
    let mut fans = Groups::new(3 * mesh.triangles.len());
    for edge in by_edge(&sides) {
        if let [a, b] = edge {
            for vertex in [edge[0].edge.0, edge[0].edge.1] {
                fans.join(corner_at(mesh, a, vertex), corner_at(mesh, b, vertex));
            }
        }
    }
    let mut fan_of = vec![u32::MAX; mesh.vertices.len()];
    mesh.triangles.iter().flatten().enumerate().all(|(corner, &vertex)| {
        let fan = fans.root(corner as u32);
        let known = &mut fan_of[vertex as usize];
        let same = *known == u32::MAX || *known == fan;
        *known = fan;
        same
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

/// Whether every edge that two triangles share is run once in each direction (and with more than two, equally
/// often in both).
pub fn is_oriented(mesh: &Mesh) -> bool {
    by_edge(&sides(mesh)).all(|edge| {
        let ascending = edge.iter().filter(|side| side.ascending).count();
        edge.len() == 1 || 2 * ascending == edge.len()
    })
}

/// Number of parts that are connected through shared vertices; vertices without a triangle do not count.
pub fn components(mesh: &Mesh) -> usize {
    let mut parts = Groups::new(mesh.vertices.len());
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
    let edges = by_edge(&sides(mesh)).count();
    vertices as i64 - edges as i64 + mesh.triangles.len() as i64
}

/// Number of handles, summed over all components: for each 1 - chi / 2; `None` unless the mesh is closed,
/// two-manifold and oriented, for then it is not defined.
pub fn genus(mesh: &Mesh) -> Option<i64> {
    (is_closed(mesh) && is_two_manifold(mesh) && is_oriented(mesh))
        .then(|| components(mesh) as i64 - euler_characteristic(mesh) / 2)
}

/// The edges that only one triangle has: (triangle, number k of the side from corner k to corner k + 1), ascending.
pub fn boundary_sides(mesh: &Mesh) -> Vec<(u32, u32)> {
    let mut boundary: Vec<(u32, u32)> = by_edge(&sides(mesh))
        .filter(|edge| edge.len() == 1)
        .map(|edge| (edge[0].corner / 3, edge[0].corner % 3))
        .collect();
    boundary.sort_unstable();
    boundary
}

/// The smallest angle of each triangle, radians; 0 for a degenerate one.
pub fn min_angles(mesh: &Mesh) -> Vec<f64> {
    let smallest = |i| {
        let corners = mesh.corners(i);
        if collinear(&corners) {
            return 0.0;
        }
        triangle_angles(&corners).into_iter().fold(f64::INFINITY, f64::min)
    };
    (0..mesh.triangles.len()).into_par_iter().map(smallest).collect()
}

/// Triangles without area, exactly: those that name a vertex twice or whose corners lie on one line; ascending.
pub fn degenerate_triangles(mesh: &Mesh) -> Vec<u32> {
    (0..mesh.triangles.len())
        .into_par_iter()
        .filter(|&i| collinear(&mesh.corners(i)))
        .map(|i| i as u32)
        .collect()
}

fn used_vertices(mesh: &Mesh) -> Vec<bool> {
    let mut used = vec![false; mesh.vertices.len()];
    for &v in mesh.triangles.iter().flatten() {
        used[v as usize] = true;
    }
    used
}

/// Disjoint sets; the root of each is its smallest member.
struct Groups(Vec<u32>);

impl Groups {
    fn new(len: usize) -> Groups {
        Groups((0..len as u32).collect())
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
    use crate::geometry::Vec3;

    fn gates(mesh: &Mesh) -> [bool; 3] {
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
            assert_eq!(gates(&mesh), [true; 3]);
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
        assert_eq!(gates(&mesh), [false, true, true]);
        assert_eq!(genus(&mesh), None);
        assert_eq!(boundary_sides(&mesh).len(), 3);
        assert_eq!(euler_characteristic(&mesh), 1);
        assert!(!is_closed(&Mesh::default()));
    }

    #[test]
    fn a_flipped_triangle_is_not_oriented() {
        let mut mesh = torus(1.0, 0.3, 24, 12);
        mesh.triangles[7].swap(0, 1);
        assert_eq!(gates(&mesh), [true, true, false]);
    }

    #[test]
    fn a_bow_tie_vertex_and_a_fin_are_not_manifold() {
        let unit = cuboid(Vec3::zeros(), Vec3::repeat(1.0));
        let mut tie = union(&unit, &cuboid(Vec3::repeat(1.0), Vec3::repeat(2.0)));
        tie.triangles.iter_mut().flatten().filter(|v| **v == 8).for_each(|v| *v = 7);
        assert_eq!(gates(&tie), [true, false, true]);
        assert_eq!(components(&tie), 1);
        let mut fin = unit.clone();
        fin.vertices.push(Vec3::repeat(-1.0));
        fin.triangles.push([0, 3, 8]);
        assert_eq!(gates(&fin), [false, false, false]);
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
