//! Moves of vertices that never make the mesh cut itself.

use crate::geometry::Vec3;
use crate::mesh::{HalfEdgeMesh, Mesh, self_intersections, self_intersections_among};

/// Rounds of taking moves back before the whole step is given up; each widens what is taken back by a ring.
const ROUNDS: usize = 6;

/// Moves each vertex to its target. Where triangles then cut each other, their vertices go back to where they
/// were, and then their neighbours', until nothing cuts; a mesh free of self-intersections stays so.
/// Returns the number of vertices that were held back.
pub(super) fn move_guarded(mesh: &mut HalfEdgeMesh, targets: &[Vec3]) -> usize {
    let before = std::mem::replace(&mut mesh.positions, targets.iter().map(stored).collect());
    let mut snapshot = mesh.snapshot();
    let mut cut = self_intersections(&snapshot);
    let mut held = vec![false; before.len()];
    for round in 0..ROUNDS {
        if cut.is_empty() {
            return held.iter().filter(|h| **h).count();
        }
        let mut back = involved(&snapshot, &cut);
        for _ in 0..round {
            back = widened(mesh, &back);
        }
        for &v in &back {
            held[v as usize] = true;
            mesh.positions[v as usize] = before[v as usize];
        }
        snapshot.vertices.clone_from(&mesh.positions);
        cut = self_intersections_among(&snapshot, &triangles_of(&snapshot, &back));
    }
    if !cut.is_empty() {
        mesh.positions = before;
        return targets.len();
    }
    held.iter().filter(|h| **h).count()
}

/// The position as a mesh file keeps it, in single precision: what is checked here must hold for what is read.
pub(super) fn stored(position: &Vec3) -> Vec3 {
    position.map(|v| f64::from(v as f32))
}

/// Vertices of the triangles in `pairs`, ascending.
pub(super) fn involved(mesh: &Mesh, pairs: &[(u32, u32)]) -> Vec<u32> {
    let triangles = pairs.iter().flat_map(|&(a, b)| [a, b]);
    sorted(triangles.flat_map(|t| mesh.triangles[t as usize]).collect())
}

fn widened(mesh: &HalfEdgeMesh, vertices: &[u32]) -> Vec<u32> {
    let rings = vertices.iter().flat_map(|&v| mesh.neighbours(v).chain([v]));
    sorted(rings.collect())
}

fn triangles_of(mesh: &Mesh, vertices: &[u32]) -> Vec<u32> {
    let mut marked = vec![false; mesh.vertices.len()];
    vertices.iter().for_each(|&v| marked[v as usize] = true);
    let touched = |t: &u32| mesh.triangles[*t as usize].iter().any(|&v| marked[v as usize]);
    (0..mesh.triangles.len() as u32).filter(touched).collect()
}

fn sorted(mut vertices: Vec<u32>) -> Vec<u32> {
    vertices.sort_unstable();
    vertices.dedup();
    vertices
}

/// Applies `edit` (splits, collapses, flips), which takes the mesh and the vertices it must leave alone. Where
/// the outcome cuts itself it is taken back and tried again with the vertices there frozen; at last all are. Vertices
/// and triangles that were removed leave no gaps.
pub(super) fn edit_guarded(
    mesh: &mut HalfEdgeMesh,
    edit: impl Fn(&mut HalfEdgeMesh, &dyn Fn(u32) -> bool),
) {
    let mut frozen = vec![false; mesh.positions.len()];
    for _ in 0..ROUNDS {
        let mut edited = mesh.clone();
        // Vertices that a split adds are younger than the list: free.
        edit(&mut edited, &|v| frozen.get(v as usize).copied().unwrap_or(false));
        edited.positions.iter_mut().for_each(|p| *p = stored(p));
        let snapshot = edited.snapshot();
        let cut = self_intersections(&snapshot);
        if cut.is_empty() {
            *mesh = edited.compacted();
            return;
        }
        let mut guilty = involved(&snapshot, &cut);
        // A guilty vertex younger than the list stands for its older neighbours.
        for _ in 0..2 {
            guilty = widened(&edited, &guilty);
        }
        for v in guilty {
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
    fn an_edit_that_cuts_is_done_without_the_guilty_vertices() {
        let shape = test_shapes::sphere(1.0, 3);
        let mut mesh = HalfEdgeMesh::new(&shape).unwrap();
        edit_guarded(&mut mesh, |mesh, frozen| {
            for v in 0..40 {
                if !frozen(v) {
                    mesh.positions[v as usize] *= if v == 7 { -1.5 } else { 1.02 };
                }
            }
        });
        assert!(self_intersections(&mesh.snapshot()).is_empty());
        assert_eq!(mesh.positions[7], stored(&shape.vertices[7]));
        assert_eq!(mesh.positions[30], stored(&(shape.vertices[30] * 1.02)));
    }
}
