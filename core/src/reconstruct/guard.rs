//! Moves of vertices that never make the mesh cut itself.

use crate::geometry::Vec3;
use crate::mesh::{HalfEdgeMesh, Mesh, self_intersections, self_intersections_among};

/// Rounds in which moves are taken back before the whole step is given up; each takes back the
/// moves of one more ring of neighbours.
const MAX_ROUNDS: usize = 6;
/// Rings of neighbours of an intersection that an edit must leave alone: a vertex that the edit
/// added stands for its older neighbours.
const FROZEN_RINGS: usize = 2;

/// Moves each vertex to its target (metres). Where triangles then intersect, their vertices go back
/// to where they were, and in further rounds their neighbours, until nothing intersects; a mesh
/// free of self-intersections stays so. Returns the number of vertices that were held back.
pub(super) fn move_guarded(mesh: &mut HalfEdgeMesh, targets: &[Vec3]) -> usize {
    let before =
        std::mem::replace(&mut mesh.positions, targets.iter().map(to_single_precision).collect());
    let mut snapshot = mesh.to_mesh();
    let mut intersections = self_intersections(&snapshot);
    let mut held = vec![false; before.len()];
    for round in 0..MAX_ROUNDS {
        if intersections.is_empty() {
            return held.iter().filter(|h| **h).count();
        }
        let mut back = intersecting_vertices(&snapshot, &intersections);
        for _ in 0..round {
            back = with_neighbours(mesh, &back);
        }
        for &v in &back {
            held[v as usize] = true;
            mesh.positions[v as usize] = before[v as usize];
        }
        snapshot.vertices.clone_from(&mesh.positions);
        intersections = self_intersections_among(&snapshot, &triangles_at(&snapshot, &back));
    }
    if !intersections.is_empty() {
        mesh.positions = before;
        return targets.len();
    }
    held.iter().filter(|h| **h).count()
}

/// The position as a mesh file holds it: what is checked here must be true of what is read.
fn to_single_precision(position: &Vec3) -> Vec3 {
    position.map(|v| f64::from(v as f32))
}

/// Vertices of the triangles in `pairs`, ascending.
fn intersecting_vertices(mesh: &Mesh, pairs: &[(u32, u32)]) -> Vec<u32> {
    let triangles = pairs.iter().flat_map(|&(a, b)| [a, b]);
    sorted_unique(triangles.flat_map(|t| mesh.triangles[t as usize]).collect())
}

/// `vertices` and their neighbours, ascending.
fn with_neighbours(mesh: &HalfEdgeMesh, vertices: &[u32]) -> Vec<u32> {
    let rings = vertices.iter().flat_map(|&v| mesh.one_ring(v).chain([v]));
    sorted_unique(rings.collect())
}

/// The triangles that have at least one of `vertices`, ascending.
fn triangles_at(mesh: &Mesh, vertices: &[u32]) -> Vec<u32> {
    let mut marked = vec![false; mesh.vertices.len()];
    vertices.iter().for_each(|&v| marked[v as usize] = true);
    (0..mesh.triangles.len() as u32)
        .filter(|&t| mesh.triangles[t as usize].iter().any(|&v| marked[v as usize]))
        .collect()
}

fn sorted_unique(mut vertices: Vec<u32>) -> Vec<u32> {
    vertices.sort_unstable();
    vertices.dedup();
    vertices
}

/// Applies `edit` (splits, collapses, flips), which takes the mesh and tells by a function which
/// vertices it must leave alone. Where the outcome intersects itself it is taken back and tried
/// again with the vertices there frozen; if that does not help, the mesh stays as it is. Vertices
/// and triangles that were removed leave no gaps.
pub(super) fn edit_guarded(
    mesh: &mut HalfEdgeMesh,
    edit: impl Fn(&mut HalfEdgeMesh, &dyn Fn(u32) -> bool),
) {
    let mut frozen = vec![false; mesh.positions.len()];
    for _ in 0..MAX_ROUNDS {
        let mut edited = mesh.clone();
        // Vertices that a split adds are not in the list, and free.
        edit(&mut edited, &|v| frozen.get(v as usize).copied().unwrap_or(false));
        edited.positions.iter_mut().for_each(|p| *p = to_single_precision(p));
        let snapshot = edited.to_mesh();
        let intersections = self_intersections(&snapshot);
        if intersections.is_empty() {
            *mesh = edited.compacted();
            return;
        }
        let mut to_freeze = intersecting_vertices(&snapshot, &intersections);
        for _ in 0..FROZEN_RINGS {
            to_freeze = with_neighbours(&edited, &to_freeze);
        }
        for v in to_freeze {
            if let Some(frozen) = frozen.get_mut(v as usize) {
                *frozen = true;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_shapes;

    #[test]
    fn a_move_through_the_opposite_side_is_held_back() {
        let shape = test_shapes::sphere(1.0, 3);
        let mut mesh = HalfEdgeMesh::new(&shape).unwrap();
        let mut targets: Vec<Vec3> = shape.vertices.iter().map(|v| v * 1.1).collect();
        targets[0] = -1.5 * shape.vertices[0];
        let held = move_guarded(&mut mesh, &targets);
        assert!(held > 0 && held < shape.vertices.len() / 2, "{held}");
        let moved = mesh.into_mesh();
        assert!(self_intersections(&moved).is_empty());
        assert!(moved.volume() > 1.2 * shape.volume());
    }

    #[test]
    fn an_edit_that_makes_intersections_is_done_without_their_vertices() {
        let shape = test_shapes::sphere(1.0, 3);
        let mut mesh = HalfEdgeMesh::new(&shape).unwrap();
        edit_guarded(&mut mesh, |mesh, frozen| {
            for v in 0..40 {
                if !frozen(v) {
                    mesh.positions[v as usize] *= if v == 7 { -1.5 } else { 1.02 };
                }
            }
        });
        assert!(self_intersections(&mesh.to_mesh()).is_empty());
        assert_eq!(mesh.positions[7], to_single_precision(&shape.vertices[7]));
        assert_eq!(mesh.positions[30], to_single_precision(&(shape.vertices[30] * 1.02)));
    }
}
