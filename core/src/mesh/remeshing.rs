//! Isotropic remeshing by edge splits, collapses and flips (Botsch & Kobbelt 2004, A Remeshing
//! Approach to Multiresolution Modeling). Bounds preserve the shape: no edit may turn a triangle's
//! normal far, and edges on ridges are not flipped.

use super::half_edge_mesh::HalfEdgeMesh;
use crate::geometry::Vec3;

/// Edges longer than this multiple of the target length are split. Together with [`MIN_EDGE_RATIO`]
/// neither edit undoes the other (Botsch & Kobbelt 2004, §4).
const MAX_EDGE_RATIO: f64 = 4.0 / 3.0;
/// Edges shorter than this multiple of the target length are collapsed.
const MIN_EDGE_RATIO: f64 = 4.0 / 5.0;
/// Growth of the edge length in one pass of coarsening. A vertex absorbs few others in a pass, so
/// that none gets so many neighbours that visiting them becomes slow.
const COARSENING_GROWTH_FACTOR: f64 = 1.4;
/// A collapse or flip may turn no triangle's normal by more than 30 degrees.
const MIN_NORMAL_COS: f64 = 0.866;
/// Edges at which the normals of the two triangles differ by more than 40 degrees are ridges.
const RIDGE_COS: f64 = 0.766;
/// A collapse may leave no triangle whose height over the edge opposite of the merged vertex is
/// below this share of that edge.
const MIN_HEIGHT_RATIO: f64 = 0.1;
/// Triangles whose height is below this share of their base are slivers.
const SLIVER_HEIGHT_RATIO: f64 = 0.05;
/// Lengths that differ by less than this are the length of an unchanged edge.
const EQUAL_LENGTH_M: f64 = 1e-12;
/// Excess over 180 degrees from which an edge is flipped, radians; rounding alone does not flip a
/// square's diagonal back and forth.
const MIN_ANGLE_EXCESS: f64 = 1e-6;

/// Runs one pass over all edges towards the edge length `target` (metres). Vertices for which
/// `frozen` is true are not removed and their edges are not flipped.
pub fn remesh(mesh: &mut HalfEdgeMesh, target: f64, frozen: impl Fn(u32) -> bool) {
    split_long_edges(mesh, MAX_EDGE_RATIO * target);
    collapse_short_edges(mesh, MIN_EDGE_RATIO * target, MAX_EDGE_RATIO * target, &frozen);
    flip_to_delaunay(mesh, &frozen);
}

/// Collapses edges that are too short for the edge length `target` (metres), in passes with growing
/// edge length. Vertices for which `frozen` is true are not removed.
pub fn coarsen(mesh: &mut HalfEdgeMesh, target: f64, frozen: impl Fn(u32) -> bool) {
    let mut length = mean_edge_length(mesh);
    while length < target {
        length = (COARSENING_GROWTH_FACTOR * length).min(target);
        collapse_short_edges(mesh, MIN_EDGE_RATIO * length, MAX_EDGE_RATIO * length, &frozen);
    }
}

/// Mean length of the edges, metres; infinite if there are none.
fn mean_edge_length(mesh: &HalfEdgeMesh) -> f64 {
    let alive = (0..mesh.half_edge_count()).filter(|&h| mesh.is_alive(h));
    let (sum, count) = alive.fold((0.0, 0.0), |(sum, n), h| (sum + mesh.edge_length(h), n + 1.0));
    if count > 0.0 { sum / count } else { f64::INFINITY }
}

/// Splits every edge longer than `max_length` (metres) at its midpoint until there is none.
fn split_long_edges(mesh: &mut HalfEdgeMesh, max_length: f64) {
    loop {
        let before = mesh.half_edge_count();
        let mut long: Vec<(u32, f64)> = (0..before)
            .filter(|&h| mesh.is_alive(h) && h < mesh.twin(h))
            .map(|h| (h, mesh.edge_length(h)))
            .filter(|(_, length)| *length > max_length)
            .collect();
        // The longest first: its halves are the least likely to need another pass.
        long.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        for (h, length) in long {
            // An earlier split of this pass may have changed the edge.
            if (mesh.edge_length(h) - length).abs() < EQUAL_LENGTH_M {
                mesh.split_edge(h, midpoint(mesh, h));
            }
        }
        if mesh.half_edge_count() == before {
            return;
        }
    }
}

/// Collapses edges shorter than `min_length` to their midpoint, the shortest first, where that
/// makes no edge longer than `max_length` (metres).
fn collapse_short_edges(
    mesh: &mut HalfEdgeMesh,
    min_length: f64,
    max_length: f64,
    frozen: &impl Fn(u32) -> bool,
) {
    let mut short: Vec<(u32, f64)> = (0..mesh.half_edge_count())
        .filter(|&h| mesh.is_alive(h) && h < mesh.twin(h))
        .map(|h| (h, mesh.edge_length(h)))
        .filter(|(_, length)| *length < min_length)
        .collect();
    short.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    for (h, _) in short {
        if !mesh.is_alive(h)
            || mesh.edge_length(h) >= min_length
            || frozen(mesh.from_vertex(h))
            || frozen(mesh.to_vertex(h))
        {
            continue;
        }
        let middle = midpoint(mesh, h);
        if mesh.can_collapse(h) && keeps_shape(mesh, h, &middle, max_length) {
            mesh.collapse_edge(h, middle);
        }
    }
}

/// Whether merging the ends of `h` at `position` turns no normal far, and makes no edge too long.
fn keeps_shape(mesh: &HalfEdgeMesh, h: u32, position: &Vec3, max_length: f64) -> bool {
    let twin = mesh.twin(h);
    let removed = [h / 3, twin / 3];
    [mesh.from_vertex(h), mesh.to_vertex(h)].into_iter().all(|v| {
        mesh.outgoing_half_edges(v).filter(|spoke| !removed.contains(&(spoke / 3))).all(|spoke| {
            let a = mesh.positions[mesh.to_vertex(spoke) as usize];
            let b = mesh.positions[mesh.opposite_vertex(spoke) as usize];
            let (before, after) =
                (mesh.doubled_area_vector(spoke), (a - position).cross(&(b - position)));
            (a - position).norm() < max_length
                && after.dot(&before) > MIN_NORMAL_COS * after.norm() * before.norm()
                // A sliver's normal is unreliable, so none may arise.
                && after.norm() > MIN_HEIGHT_RATIO * (a - b).norm_squared()
        })
    })
}

/// Flips edges that are not Delaunay.
fn flip_to_delaunay(mesh: &mut HalfEdgeMesh, frozen: &impl Fn(u32) -> bool) {
    for h in 0..mesh.half_edge_count() {
        if !mesh.is_alive(h) || h > mesh.twin(h) {
            continue;
        }
        let corners = [
            mesh.from_vertex(h),
            mesh.to_vertex(h),
            mesh.opposite_vertex(h),
            mesh.opposite_vertex(mesh.twin(h)),
        ];
        if corners.into_iter().any(frozen) {
            continue;
        }
        if should_flip(mesh, h) && mesh.can_flip(h) {
            mesh.flip_edge(h);
        }
    }
}

/// Whether the angles opposite of `h` sum to more than 180 degrees (the edge is not Delaunay) and
/// the surface is nearly flat before and after the flip.
fn should_flip(mesh: &HalfEdgeMesh, h: u32) -> bool {
    let twin = mesh.twin(h);
    let [from, to, a, b] = [
        mesh.from_vertex(h),
        mesh.to_vertex(h),
        mesh.opposite_vertex(h),
        mesh.opposite_vertex(twin),
    ]
    .map(|v| mesh.positions[v as usize]);
    let angle_sum = (from - a).angle(&(to - a)) + (from - b).angle(&(to - b));
    if angle_sum < std::f64::consts::PI + MIN_ANGLE_EXCESS {
        return false;
    }
    let before = [mesh.doubled_area_vector(h), mesh.doubled_area_vector(twin)];
    let after = [(from - a).cross(&(b - a)), (to - b).cross(&(a - b))];
    // A sliver has no reliable normal, so the flip that removes it is judged by the other triangle.
    let sum = before[0] + before[1];
    (is_angle_below(&before[0], &before[1], RIDGE_COS)
        || is_sliver(mesh, h)
        || is_sliver(mesh, twin))
        && after.iter().all(|n| is_angle_below(n, &sum, MIN_NORMAL_COS))
}

/// Whether the angle between two vectors has a cosine above `cosine`.
fn is_angle_below(p: &Vec3, q: &Vec3, cosine: f64) -> bool {
    p.dot(q) > cosine * p.norm() * q.norm()
}

/// Whether the triangle of `h` is so flat over `h` that its normal is unreliable.
fn is_sliver(mesh: &HalfEdgeMesh, h: u32) -> bool {
    mesh.doubled_area_vector(h).norm() < SLIVER_HEIGHT_RATIO * mesh.edge_length(h).powi(2)
}

/// The middle of the edge of `h`.
fn midpoint(mesh: &HalfEdgeMesh, h: u32) -> Vec3 {
    let [from, to] = [mesh.from_vertex(h), mesh.to_vertex(h)].map(|v| mesh.positions[v as usize]);
    (from + to) / 2.0
}

/// Unit vertex normals, weighted by the triangles' areas; zero for removed vertices.
pub fn vertex_normals(mesh: &HalfEdgeMesh) -> Vec<Vec3> {
    let mut normals = vec![Vec3::zeros(); mesh.positions.len()];
    for h in (0..mesh.half_edge_count()).filter(|h| mesh.is_alive(*h)) {
        normals[mesh.from_vertex(h) as usize] += mesh.doubled_area_vector(h);
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

    #[test]
    fn an_obtuse_diagonal_flips_and_a_ridge_does_not() {
        // A flat box whose top is a long rhombus of two triangles with the long diagonal.
        for (height, expected) in [(0.0, true), (0.5, false)] {
            let vertices = [
                [-1.0, 0.0, 0.0],
                [1.0, 0.0, 0.0],
                [0.0, 0.4, -height],
                [0.0, -0.4, -height],
                [0.0, 0.0, -2.0],
            ];
            let triangles = vec![[0, 1, 2], [1, 0, 3], [1, 4, 2], [2, 4, 0], [0, 4, 3], [3, 4, 1]];
            let shape = Mesh::new(vertices.map(Vec3::from).to_vec(), triangles);
            let mesh = HalfEdgeMesh::new(&shape).unwrap();
            assert_eq!(should_flip(&mesh, 0), expected, "height {height}");
        }
    }

    #[test]
    fn splitting_leaves_no_long_edge_and_keeps_the_surface() {
        let shape = test_shapes::cuboid(Vec3::zeros(), Vec3::new(1.0, 2.0, 0.5));
        let mut mesh = HalfEdgeMesh::new(&shape).unwrap();
        split_long_edges(&mut mesh, 0.3);
        assert!((0..mesh.half_edge_count()).all(|h| mesh.edge_length(h) <= 0.3));
        let plain = mesh.into_mesh();
        assert!((plain.area() - shape.area()).abs() < 1e-9);
        assert!((plain.volume() - shape.volume()).abs() < 1e-9);
    }

    #[test]
    fn vertex_normals_are_those_of_the_plain_mesh() {
        let shape = test_shapes::torus(1.0, 0.3, 12, 8);
        let mut plain = shape.clone();
        plain.compute_normals();
        let normals = vertex_normals(&HalfEdgeMesh::new(&shape).unwrap());
        for (a, b) in normals.iter().zip(&plain.normals) {
            assert!((a - b).norm() < 1e-12);
        }
    }
}
