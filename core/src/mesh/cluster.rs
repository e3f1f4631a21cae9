//! A mesh with few triangles, to look at: vertex clustering (Rossignac & Borrel 1993, Multi-resolution 3D approximations
//! for rendering complex scenes).

use super::Mesh;
use crate::geometry::Vec3;
use std::collections::{BTreeMap, BTreeSet};

/// Growth of the cells from one try to the next.
const GROWTH: f64 = 1.1;

/// The mesh, or if it has more than `most` triangles, one of at most `most`: vertices in one cell of a grid become one.
/// Shape, sigma and what is observed are kept on the whole; it need not be closed or two-manifold, and has no normals.
pub fn clustered(mesh: &Mesh, most: usize) -> Mesh {
    if mesh.triangles.len() <= most {
        return mesh.clone();
    }
    // A grid cuts a surface into about one vertex a cell, and there are two triangles for each.
    let mut edge = (2.0 * mesh.area() / most.max(1) as f64).sqrt().max(1e-9);
    let largest = mesh.aabb().diagonal();
    loop {
        let coarse = in_cells(mesh, edge);
        if coarse.triangles.len() <= most || edge > largest {
            return coarse;
        }
        edge *= GROWTH;
    }
}

fn in_cells(mesh: &Mesh, edge: f64) -> Mesh {
    let corner = mesh.aabb().min;
    let cell = |v: &Vec3| <[f64; 3]>::from(v - corner).map(|c| (c / edge).floor() as i64);
    let mut numbers: BTreeMap<[i64; 3], u32> = BTreeMap::new();
    let cells: Vec<u32> = mesh
        .vertices
        .iter()
        .map(|v| {
            let next = numbers.len() as u32;
            *numbers.entry(cell(v)).or_insert(next)
        })
        .collect();
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); numbers.len()];
    for (vertex, cell) in cells.iter().enumerate() {
        members[*cell as usize].push(vertex);
    }
    let mean =
        |of: &Vec<usize>| of.iter().map(|v| mesh.vertices[*v]).sum::<Vec3>() / of.len() as f64;
    // As sure as its least sure part: none, where something was not measured.
    let worst =
        |of: &Vec<usize>| of.iter().fold(0.0, |worst: f64, v| larger(worst, mesh.sigma[*v]));
    let mut seen = BTreeSet::new();
    let corners = mesh.triangles.iter().map(|t| t.map(|v| cells[v as usize]));
    let triangles = corners.filter(|[a, b, c]| a != b && b != c && c != a);
    Mesh {
        vertices: members.iter().map(mean).collect(),
        triangles: triangles.filter(|t| seen.insert(turned(*t))).collect(),
        normals: Vec::new(),
        sigma: if mesh.sigma.is_empty() { Vec::new() } else { members.iter().map(worst).collect() },
        observed: if mesh.observed.is_empty() {
            Vec::new()
        } else {
            members.iter().map(|of| of.iter().all(|v| mesh.observed[*v])).collect()
        },
    }
}

/// The larger number; NaN if one is.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

/// The same triangle, beginning with its least vertex.
fn turned([a, b, c]: [u32; 3]) -> [u32; 3] {
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
        let whole = clustered(&ball, ball.triangles.len());
        assert_eq!(
            (whole.triangles, whole.vertices),
            (ball.triangles.clone(), ball.vertices.clone())
        );
        for most in [2000, 300] {
            let coarse = clustered(&ball, most);
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
        assert!(clustered(&ball, 0).triangles.is_empty());
    }
}
