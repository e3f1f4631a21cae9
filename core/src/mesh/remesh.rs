//! Isotropic remeshing by edge splits, collapses and flips (Botsch & Kobbelt 2004, A Remeshing Approach to
//! Multiresolution Modeling), with bounds that keep the shape: no triangle may turn far, no ridge is flipped.

use super::half_edge::HalfEdgeMesh;
use crate::geometry::Vec3;

/// Edges longer than this share of the target are split, shorter than the second collapsed: the pair for which
/// neither edit undoes the other (Botsch & Kobbelt 2004, §4).
const LONG: f64 = 4.0 / 3.0;
const SHORT: f64 = 4.0 / 5.0;
/// Growth of the edge length in one pass of coarsening: a vertex takes in few others at once, so that none gets so many
/// neighbours that asking them takes long.
const COARSENING_STEP: f64 = 1.4;
/// A collapse or flip may turn no triangle farther (30 degrees).
const LARGEST_TURN: f64 = 0.866;
/// Edges with a sharper dihedral than this are ridges (40 degrees).
const RIDGE: f64 = 0.766;

/// One pass over all edges towards the edge length `target` (metres). Vertices for which `frozen` holds are
/// neither removed nor do their edges flip.
pub fn remesh(mesh: &mut HalfEdgeMesh, target: f64, frozen: impl Fn(u32) -> bool) {
    split_long(mesh, LONG * target);
    collapse_short(mesh, SHORT * target, LONG * target, &frozen);
    flip_obtuse(mesh, &frozen);
}

/// Collapses edges that are too short for the edge length `target` (metres), in passes that ask for ever longer edges. Vertices
/// for which `frozen` holds are not removed.
pub fn coarsen(mesh: &mut HalfEdgeMesh, target: f64, frozen: impl Fn(u32) -> bool) {
    let mut length = mean_length(mesh);
    while length < target {
        length = (COARSENING_STEP * length).min(target);
        collapse_short(mesh, SHORT * length, LONG * length, &frozen);
    }
}

/// Mean length of the edges, metres; infinite if there are none.
fn mean_length(mesh: &HalfEdgeMesh) -> f64 {
    let alive = (0..mesh.half_edges()).filter(|&h| mesh.is_alive(h));
    let (sum, count) = alive.fold((0.0, 0.0), |(sum, n), h| (sum + mesh.length(h), n + 1.0));
    if count > 0.0 { sum / count } else { f64::INFINITY }
}

/// Splits every edge longer than `longest` (metres) in its middle until there is none.
fn split_long(mesh: &mut HalfEdgeMesh, longest: f64) {
    loop {
        let before = mesh.half_edges();
        let mut long: Vec<(u32, f64)> = (0..before)
            .filter(|&h| mesh.is_alive(h) && h < mesh.twin(h))
            .map(|h| (h, mesh.length(h)))
            .filter(|(_, length)| *length > longest)
            .collect();
        // The longest first: its halves are the least likely to need another pass.
        long.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        for (h, length) in long {
            // An earlier split of this pass may have shortened it.
            if (mesh.length(h) - length).abs() < 1e-12 {
                let middle = (mesh.positions[mesh.from(h) as usize]
                    + mesh.positions[mesh.to(h) as usize])
                    / 2.0;
                mesh.split(h, middle);
            }
        }
        if mesh.half_edges() == before {
            return;
        }
    }
}

fn collapse_short(
    mesh: &mut HalfEdgeMesh,
    shortest: f64,
    longest: f64,
    frozen: &impl Fn(u32) -> bool,
) {
    let mut short: Vec<(u32, f64)> = (0..mesh.half_edges())
        .filter(|&h| mesh.is_alive(h) && h < mesh.twin(h))
        .map(|h| (h, mesh.length(h)))
        .filter(|(_, length)| *length < shortest)
        .collect();
    short.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    for (h, _) in short {
        if !mesh.is_alive(h)
            || mesh.length(h) >= shortest
            || frozen(mesh.from(h))
            || frozen(mesh.to(h))
        {
            continue;
        }
        let middle =
            (mesh.positions[mesh.from(h) as usize] + mesh.positions[mesh.to(h) as usize]) / 2.0;
        if mesh.can_collapse(h) && keeps_shape(mesh, h, &middle, longest) {
            mesh.collapse(h, middle);
        }
    }
}

/// Whether merging the ends of `h` at `position` turns no triangle far, and makes no edge too long.
fn keeps_shape(mesh: &HalfEdgeMesh, h: u32, position: &Vec3, longest: f64) -> bool {
    let twin = mesh.twin(h);
    let gone = [h / 3, twin / 3];
    [mesh.from(h), mesh.to(h)].into_iter().all(|v| {
        mesh.ring(v).filter(|spoke| !gone.contains(&(spoke / 3))).all(|spoke| {
            let a = mesh.positions[mesh.to(spoke) as usize];
            let b = mesh.positions[mesh.apex(spoke) as usize];
            let (before, after) = (mesh.area_vector(spoke), (a - position).cross(&(b - position)));
            (a - position).norm() < longest
                && after.dot(&before) > LARGEST_TURN * after.norm() * before.norm()
                // A sliver has an unreliable normal; do not make one.
                && after.norm() > 0.1 * (a - b).norm_squared()
        })
    })
}

fn flip_obtuse(mesh: &mut HalfEdgeMesh, frozen: &impl Fn(u32) -> bool) {
    for h in 0..mesh.half_edges() {
        if !mesh.is_alive(h) || h > mesh.twin(h) {
            continue;
        }
        let corners = [mesh.from(h), mesh.to(h), mesh.apex(h), mesh.apex(mesh.twin(h))];
        if corners.into_iter().any(frozen) {
            continue;
        }
        if flip_helps(mesh, h) && mesh.can_flip(h) {
            mesh.flip(h);
        }
    }
}

/// Whether the angles opposite of `h` sum to more than 180 degrees (Delaunay), on a surface that is nearly flat
/// before and after.
fn flip_helps(mesh: &HalfEdgeMesh, h: u32) -> bool {
    let twin = mesh.twin(h);
    let at = |v: u32| mesh.positions[v as usize];
    let (from, to, a, b) =
        (at(mesh.from(h)), at(mesh.to(h)), at(mesh.apex(h)), at(mesh.apex(twin)));
    let angle = |apex: Vec3| (from - apex).angle(&(to - apex));
    if angle(a) + angle(b) < std::f64::consts::PI + 1e-6 {
        return false;
    }
    let alike = |p: &Vec3, q: &Vec3, cosine: f64| p.dot(q) > cosine * p.norm() * q.norm();
    let before = [mesh.area_vector(h), mesh.area_vector(twin)];
    let after = [(from - a).cross(&(b - a)), (to - b).cross(&(a - b))];
    // Slivers have no reliable normal; the flip that removes one is judged by the other triangles.
    let sum = before[0] + before[1];
    (alike(&before[0], &before[1], RIDGE) || sliver(mesh, h) || sliver(mesh, twin))
        && after.iter().all(|n| alike(n, &sum, LARGEST_TURN))
}

fn sliver(mesh: &HalfEdgeMesh, h: u32) -> bool {
    mesh.area_vector(h).norm() < 0.05 * mesh.length(h).powi(2)
}

/// Unit vertex normals, weighted by area; zero for removed vertices.
pub fn vertex_normals(mesh: &HalfEdgeMesh) -> Vec<Vec3> {
    let mut normals = vec![Vec3::zeros(); mesh.positions.len()];
    for h in (0..mesh.half_edges()).filter(|h| mesh.is_alive(*h)) {
        normals[mesh.from(h) as usize] += mesh.area_vector(h);
    }
    normals.into_iter().map(|n| n.try_normalize(0.0).unwrap_or_else(Vec3::zeros)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{
        Mesh, genus, is_closed, is_two_manifold, min_angles, self_intersections, test_shapes,
    };

    #[test]
    fn edges_come_near_the_target_and_the_shape_stays() {
        let shape = test_shapes::torus(1.0, 0.35, 40, 16);
        for target in [0.05, 0.15] {
            let mut mesh = HalfEdgeMesh::new(&shape).unwrap();
            for _ in 0..4 {
                remesh(&mut mesh, target, |_| false);
            }
            let plain = mesh.into_mesh();
            assert!(is_closed(&plain) && is_two_manifold(&plain));
            assert_eq!(genus(&plain), Some(1));
            assert!(self_intersections(&plain).is_empty());
            assert!((plain.volume() / shape.volume() - 1.0).abs() < 0.05);
            let edge = (plain.area() / plain.triangles.len() as f64 / 0.433).sqrt();
            assert!(edge / target > 0.7 && edge / target < 1.3, "{edge} {target}");
            let mut angles = min_angles(&plain);
            angles.sort_by(f64::total_cmp);
            assert!(angles[angles.len() / 20] > 0.3, "{}", angles[angles.len() / 20]);
        }
    }

    #[test]
    fn coarsening_keeps_the_shape_and_stops() {
        let shape = test_shapes::torus(1.0, 0.35, 160, 64);
        let mut mesh = HalfEdgeMesh::new(&shape).unwrap();
        coarsen(&mut mesh, 0.15, |_| false);
        let plain = mesh.into_mesh();
        assert!(plain.triangles.len() < shape.triangles.len() / 5, "{}", plain.triangles.len());
        assert!(is_closed(&plain) && is_two_manifold(&plain));
        assert_eq!(genus(&plain), Some(1));
        assert!((plain.volume() / shape.volume() - 1.0).abs() < 0.05);
        let mut frozen = HalfEdgeMesh::new(&shape).unwrap();
        coarsen(&mut frozen, 0.15, |_| true);
        assert_eq!(frozen.into_mesh(), Mesh::new(shape.vertices, shape.triangles));
    }

    #[test]
    fn a_frozen_mesh_is_only_split() {
        let shape = test_shapes::sphere(1.0, 3);
        let mut mesh = HalfEdgeMesh::new(&shape).unwrap();
        remesh(&mut mesh, 10.0, |_| true);
        assert_eq!(mesh.into_mesh().triangles, shape.triangles);
    }
}
