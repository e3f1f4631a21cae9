//! Self-intersections of a mesh: a tree of bounding boxes gives candidate pairs, an exact test
//! decides.

use super::Mesh;
use super::aabb_tree::AabbTree;
use super::triangle::{
    intersect_beyond_shared_vertex, overlap_beyond_shared_edge, triangles_intersect,
};
use crate::geometry::{Aabb, Vec3};
use rayon::prelude::*;

/// All pairs of triangles that share a point outside the vertex or edge that they have in common by
/// index; the smaller index first, sorted.
///
/// Touching counts, as do coplanar overlaps, a triangle that folds back onto its neighbour, and
/// triangles at one vertex that pierce each other. The test is exact for the given coordinates.
pub fn self_intersections(mesh: &Mesh) -> Vec<(u32, u32)> {
    let all: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
    self_intersections_among(mesh, &all)
}

/// The pairs of [`self_intersections`] in which at least one triangle is among `candidates` (in any
/// order).
///
/// With few candidates this costs little more than one pass over the boxes of all triangles.
pub fn self_intersections_among(mesh: &Mesh, candidates: &[u32]) -> Vec<(u32, u32)> {
    let boxes: Vec<Aabb> = (0..mesh.triangles.len())
        .into_par_iter()
        .map(|i| Aabb::from_points(&mesh.corners(i)))
        .collect();
    let mut is_candidate = vec![false; boxes.len()];
    for &c in candidates {
        is_candidate[c as usize] = true;
    }
    let items = (0..boxes.len()).filter(|&i| is_candidate[i]).map(|i| (i as u32, boxes[i]));
    let tree = AabbTree::new(items.collect());
    let mut pairs: Vec<(u32, u32)> = boxes
        .par_iter()
        .enumerate()
        .fold(Vec::new, |mut pairs, (i, aabb)| {
            tree.for_each_intersecting(aabb, |candidate| {
                let other = candidate as usize;
                // Two candidates find each other twice, and each candidate finds itself.
                let is_first = !is_candidate[i] || i < other;
                if is_first && do_triangles_intersect(mesh, i, other) {
                    pairs.push((i.min(other) as u32, i.max(other) as u32));
                }
            });
            pairs
        })
        .reduce(Vec::new, |mut a, mut b| {
            a.append(&mut b);
            a
        });
    pairs.par_sort_unstable();
    pairs
}

/// Whether triangles `i` and `j` share a point outside their common vertex or edge.
fn do_triangles_intersect(mesh: &Mesh, i: usize, j: usize) -> bool {
    let (a, b) = (&mesh.triangles[i], &mesh.triangles[j]);
    let vertices = &mesh.vertices;
    let mut shared = [0u32; 3];
    let mut count = 0;
    for &v in a {
        if b.contains(&v) && !shared[..count].contains(&v) {
            shared[count] = v;
            count += 1;
        }
    }
    let shared = &shared[..count];
    match (count, corners_outside(mesh, a, shared), corners_outside(mesh, b, shared)) {
        (0, _, _) => triangles_intersect(&mesh.corners(i), &mesh.corners(j)),
        (1, [Some(a0), Some(a1)], [Some(b0), Some(b1)]) => {
            intersect_beyond_shared_vertex(&vertices[shared[0] as usize], &[a0, a1], &[b0, b1])
        }
        (2, [Some(p), _], [Some(q), _]) => {
            let [u, v] = [shared[0], shared[1]].map(|v| vertices[v as usize]);
            overlap_beyond_shared_edge(&u, &v, &p, &q)
        }
        (3, _, _) => true,
        // A triangle that has a vertex twice is no more than the common edge; `is_two_manifold`
        // rejects it.
        _ => false,
    }
}

/// Positions of up to two corners of a triangle that are not in `shared`.
fn corners_outside(mesh: &Mesh, triangle: &[u32; 3], shared: &[u32]) -> [Option<Vec3>; 2] {
    let mut others = triangle.iter().filter(|v| !shared.contains(v));
    [others.next(), others.next()].map(|v| v.map(|v| mesh.vertices[*v as usize]))
}

#[cfg(test)]
mod tests {
    use super::super::test_shapes::{cuboid, sphere, torus, union};
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn brute_force(mesh: &Mesh) -> Vec<(u32, u32)> {
        let n = mesh.triangles.len();
        let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
        pairs
            .filter(|&(i, j)| do_triangles_intersect(mesh, i, j))
            .map(|(i, j)| (i as u32, j as u32))
            .collect()
    }

    /// A bar along x that starts at `x`.
    fn bar_from(x: f64) -> Mesh {
        cuboid(Vec3::new(x, 0.25, 0.25), Vec3::new(x + 1.0, 0.75, 0.75))
    }

    #[test]
    fn clean_shapes_have_none() {
        for mesh in
            [sphere(1.0, 3), torus(1.0, 0.3, 40, 20), cuboid(Vec3::zeros(), Vec3::repeat(1.0))]
        {
            assert_eq!(self_intersections(&mesh), []);
        }
    }

    #[test]
    fn pierced_boxes_touching_boxes_and_distant_boxes() {
        let unit = cuboid(Vec3::zeros(), Vec3::repeat(1.0));
        let pierced = union(&unit, &bar_from(0.5));
        let pairs = self_intersections(&pierced);
        assert!(!pairs.is_empty());
        assert!(pairs.iter().all(|&(a, b)| a < 12 && b >= 12));
        assert!(!self_intersections(&union(&unit, &bar_from(1.0))).is_empty());
        assert_eq!(self_intersections(&union(&unit, &bar_from(1.0 + f64::EPSILON))), []);
        // Nested without contact.
        let inner = cuboid(Vec3::repeat(0.25), Vec3::repeat(0.75));
        assert_eq!(self_intersections(&union(&unit, &inner)), []);
    }

    #[test]
    fn a_folded_neighbour_and_a_duplicate_are_found() {
        let vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.6, 0.4, 0.0]];
        for (triangles, expected) in [
            (vec![[0, 1, 2], [1, 0, 3]], vec![(0, 1)]),
            (vec![[0, 1, 2], [1, 0, 2]], vec![(0, 1)]),
            // The three parts of a triangle cut at an inner point do not overlap.
            (vec![[0, 1, 3], [1, 2, 3], [2, 0, 3]], vec![]),
        ] {
            let mesh = Mesh::new(vertices.map(Vec3::from).to_vec(), triangles);
            assert_eq!(self_intersections(&mesh), expected);
        }
    }

    #[test]
    fn a_vertex_on_another_face_counts() {
        let mut mesh = sphere(1.0, 2);
        let face = mesh.corners(0);
        let touching = (face[0] + face[1]) / 2.0;
        mesh.vertices.extend([touching, touching * 2.0, touching * 2.0 + Vec3::x()]);
        let v = mesh.vertices.len() as u32;
        mesh.triangles.push([v - 3, v - 2, v - 1]);
        mesh.vertices[v as usize - 3] *= 0.999;
        let last = mesh.triangles.len() as u32 - 1;
        assert!(self_intersections(&mesh).iter().all(|p| p.1 == last));
        assert!(!self_intersections(&mesh).is_empty());
        mesh.vertices[v as usize - 3] *= 1.01;
        assert_eq!(self_intersections(&mesh), []);
    }

    #[test]
    fn random_triangles_agree_with_brute_force_and_with_candidates() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        for round in 0..20 {
            // Coarse coordinates make touching and coplanar pairs common.
            let grid = if round % 2 == 0 { 6.0 } else { 1e9 };
            let vertices: Vec<Vec3> = (0..80)
                .map(|_| Vec3::from_fn(|_, _| (rng.random::<f64>() * grid).floor() / grid))
                .collect();
            let triangles: Vec<[u32; 3]> =
                (0..120).map(|_| std::array::from_fn(|_| rng.random_range(0..80))).collect();
            let mesh = Mesh::new(vertices, triangles);
            let expected = brute_force(&mesh);
            assert!(!expected.is_empty());
            assert_eq!(self_intersections(&mesh), expected);
            let candidates: Vec<u32> = (0..20).map(|_| rng.random_range(0..120)).collect();
            let involved: Vec<(u32, u32)> = expected
                .into_iter()
                .filter(|(a, b)| candidates.contains(a) || candidates.contains(b))
                .collect();
            assert_eq!(self_intersections_among(&mesh, &candidates), involved);
        }
    }

    #[test]
    fn crossing_spheres_cut_along_one_closed_line() {
        let a = sphere(1.0, 3);
        let mut b = sphere(1.0, 3);
        b.vertices.iter_mut().for_each(|v| *v += Vec3::new(0.8, 0.113, 0.071));
        let both = union(&a, &b);
        let pairs = self_intersections(&both);
        assert_eq!(pairs, brute_force(&both));
        // A closed line leaves each of its triangle pairs through one edge: at least as many pairs
        // as triangles.
        assert!(pairs.len() > 100);
    }
}
