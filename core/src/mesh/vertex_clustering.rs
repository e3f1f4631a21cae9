//! Vertex clustering: a mesh with few triangles for display (Rossignac & Borrel 1993,
//! Multi-resolution 3D approximations for rendering complex scenes).

use super::Mesh;
use crate::geometry::Vec3;
use std::collections::{BTreeMap, BTreeSet};

/// Growth of the cells from one attempt to the next.
const CELL_GROWTH_FACTOR: f64 = 1.1;

/// Smallest edge of the grid's cells, metres: keeps the grid defined for a mesh without area.
const MIN_CELL_EDGE_M: f64 = 1e-9;

/// Returns a mesh with at most `max_triangles` triangles: a copy of `mesh` if it has no more, else
/// a simplified one in which all vertices in one cell of a grid are merged.
///
/// A merged vertex lies at the mean of its members. It has the largest sigma of them (NaN if one
/// was not measured) and is observed if all of them are. The result need not be closed or
/// two-manifold and has no normals.
pub fn simplify_by_clustering(mesh: &Mesh, max_triangles: usize) -> Mesh {
    if mesh.triangles.len() <= max_triangles {
        return mesh.clone();
    }
    // A surface has about one vertex in each cell that it crosses, and two triangles for each
    // vertex.
    let cells_area = 2.0 * mesh.area() / max_triangles.max(1) as f64;
    let mut edge = cells_area.sqrt().max(MIN_CELL_EDGE_M);
    let largest = mesh.aabb().diagonal();
    loop {
        let coarse = cluster_vertices(mesh, edge);
        if coarse.triangles.len() <= max_triangles || edge > largest {
            return coarse;
        }
        edge *= CELL_GROWTH_FACTOR;
    }
}

/// Merges all vertices in one cell of a grid with cells of length `edge` (metres).
fn cluster_vertices(mesh: &Mesh, edge: f64) -> Mesh {
    let origin = mesh.aabb().min;
    let mut numbers: BTreeMap<[i64; 3], u32> = BTreeMap::new();
    let cells: Vec<u32> = mesh
        .vertices
        .iter()
        .map(|v| {
            let next = numbers.len() as u32;
            let cell = <[f64; 3]>::from(v - origin).map(|c| (c / edge).floor() as i64);
            *numbers.entry(cell).or_insert(next)
        })
        .collect();
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); numbers.len()];
    for (vertex, cell) in cells.iter().enumerate() {
        members[*cell as usize].push(vertex);
    }
    let vertices = members
        .iter()
        .map(|of| of.iter().map(|v| mesh.vertices[*v]).sum::<Vec3>() / of.len() as f64);
    let mut seen = BTreeSet::new();
    let corners = mesh.triangles.iter().map(|t| t.map(|v| cells[v as usize]));
    let triangles = corners.filter(|[a, b, c]| a != b && b != c && c != a);
    Mesh {
        vertices: vertices.collect(),
        triangles: triangles.filter(|t| seen.insert(rotate_to_smallest_index(*t))).collect(),
        normals: Vec::new(),
        sigma: merge_attribute(&mesh.sigma, &members, 0.0, max_or_nan),
        observed: merge_attribute(&mesh.observed, &members, true, |all, one| all && one),
    }
}

/// Folds the attribute of the members of each merged vertex; empty if the mesh does not have the
/// attribute.
fn merge_attribute<T: Copy>(
    values: &[T],
    members: &[Vec<usize>],
    start: T,
    merge: fn(T, T) -> T,
) -> Vec<T> {
    if values.is_empty() {
        return Vec::new();
    }
    members.iter().map(|of| of.iter().fold(start, |merged, v| merge(merged, values[*v]))).collect()
}

/// The larger number; NaN if one of them is NaN.
fn max_or_nan(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

/// The same triangle with its smallest vertex index first.
fn rotate_to_smallest_index([a, b, c]: [u32; 3]) -> [u32; 3] {
    match a.min(b).min(c) {
        least if least == a => [a, b, c],
        least if least == b => [b, c, a],
        _ => [c, a, b],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_shapes::sphere;

    #[test]
    fn few_triangles_keep_the_shape_and_what_is_least_sure() {
        let mut ball = sphere(0.05, 4);
        ball.sigma = vec![1e-4; ball.vertices.len()];
        ball.observed = vec![true; ball.vertices.len()];
        let top = (0..ball.vertices.len())
            .max_by(|a, b| ball.vertices[*a].z.total_cmp(&ball.vertices[*b].z))
            .unwrap();
        (ball.sigma[top], ball.observed[top]) = (f64::NAN, false);
        let whole = simplify_by_clustering(&ball, ball.triangles.len());
        assert_eq!(
            (whole.triangles, whole.vertices),
            (ball.triangles.clone(), ball.vertices.clone())
        );
        for most in [2000, 300] {
            let coarse = simplify_by_clustering(&ball, most);
            let count = coarse.triangles.len();
            assert!((most / 3..=most).contains(&count), "{count} of {most}");
            let shrunk = coarse.area() / ball.area();
            assert!((0.6..=1.05).contains(&shrunk), "{most}: {shrunk}");
            assert!(coarse.vertices.iter().all(|v| v.norm() < 0.0501));
            let unsure: Vec<usize> =
                (0..coarse.vertices.len()).filter(|v| coarse.sigma[*v].is_nan()).collect();
            assert_eq!(unsure.len(), 1);
            assert!(!coarse.observed[unsure[0]] && coarse.vertices[unsure[0]].z > 0.02);
        }
        assert!(simplify_by_clustering(&ball, 0).triangles.is_empty());
    }

    #[test]
    fn a_merged_vertex_is_the_mean_of_its_cell() {
        let ball = sphere(0.05, 2);
        let edge = 0.02;
        let coarse = cluster_vertices(&ball, edge);
        let origin = ball.aabb().min;
        for vertex in &coarse.vertices {
            // Brute force: the vertices in the cell of a member of this mean.
            let matches = ball.vertices.iter().any(|seed| {
                let cell = ((seed - origin) / edge).map(f64::floor);
                let same_cell =
                    ball.vertices.iter().filter(|v| ((*v - origin) / edge).map(f64::floor) == cell);
                let members: Vec<&Vec3> = same_cell.collect();
                let mean = members.iter().copied().sum::<Vec3>() / members.len() as f64;
                (mean - vertex).norm() < 1e-12
            });
            assert!(matches);
        }
    }

    #[test]
    fn triangles_start_with_their_smallest_index_and_nan_wins() {
        for triangle in [[1, 2, 3], [3, 1, 2], [2, 3, 1]] {
            assert_eq!(rotate_to_smallest_index(triangle), [1, 2, 3]);
        }
        assert_eq!(rotate_to_smallest_index([2, 1, 3]), [1, 3, 2]);
        assert_eq!(max_or_nan(1.0, 2.0), 2.0);
        assert!(max_or_nan(f64::NAN, 2.0).is_nan() && max_or_nan(1.0, f64::NAN).is_nan());
    }
}
