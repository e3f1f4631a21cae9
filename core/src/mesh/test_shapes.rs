//! Analytic meshes for the tests.

use super::Mesh;
use crate::geometry::Vec3;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// A sphere about the origin: an icosahedron, each triangle cut in four `levels` times.
pub(crate) fn sphere(radius: f64, levels: usize) -> Mesh {
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    let mut vertices = Vec::new();
    for (a, b) in [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)] {
        vertices.push(Vec3::new(a, b, 0.0).normalize() * radius);
    }
    for i in 0..4 {
        vertices.push(vertices[i].zxy());
    }
    for i in 0..4 {
        vertices.push(vertices[i].yzx());
    }
    #[rustfmt::skip]
    let mut triangles: Vec<[u32; 3]> = vec![
        [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2],
        [10, 7, 6], [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5],
        [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1],
    ];
    for _ in 0..levels {
        let mut middles = BTreeMap::new();
        let mut cut = Vec::with_capacity(4 * triangles.len());
        for &[a, b, c] in &triangles {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(i, j): (u32, u32)| {
                *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    let sum = vertices[i as usize] + vertices[j as usize];
                    vertices.push(sum.normalize() * radius);
                    vertices.len() as u32 - 1
                })
            });
            cut.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = cut;
    }
    Mesh::new(vertices, triangles)
}

/// A torus about the z axis with `n` x `m` quads.
pub(crate) fn torus(major: f64, minor: f64, n: u32, m: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..n {
        for j in 0..m {
            let (u, v) = (TAU * f64::from(i) / f64::from(n), TAU * f64::from(j) / f64::from(m));
            let ring = major + minor * v.cos();
            mesh.vertices.push(Vec3::new(ring * u.cos(), ring * u.sin(), minor * v.sin()));
            let [p, q, r, s] =
                [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(a, b)| (a % n) * m + b % m);
            mesh.triangles.extend([[p, q, r], [p, r, s]]);
        }
    }
    mesh
}

/// An octahedron with its corners on the axes at distance 1, outward, in the order x, -x, y, -y, z,
/// -z.
pub(crate) fn octahedron() -> Mesh {
    let corners = [Vec3::x(), -Vec3::x(), Vec3::y(), -Vec3::y(), Vec3::z(), -Vec3::z()];
    let triangles = vec![
        [0, 2, 4],
        [2, 1, 4],
        [1, 3, 4],
        [3, 0, 4],
        [2, 0, 5],
        [1, 2, 5],
        [3, 1, 5],
        [0, 3, 5],
    ];
    Mesh::new(corners.to_vec(), triangles)
}

/// An axis-aligned box with 12 triangles.
pub(crate) fn cuboid(min: Vec3, max: Vec3) -> Mesh {
    let vertices = (0..8)
        .map(|i| Vec3::from_fn(|axis, _| if i >> axis & 1 == 0 { min[axis] } else { max[axis] }))
        .collect();
    #[rustfmt::skip]
    let triangles = vec![
        [0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4],
        [2, 6, 7], [2, 7, 3], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5],
    ];
    Mesh::new(vertices, triangles)
}

/// Both meshes in one.
pub(crate) fn union(a: &Mesh, b: &Mesh) -> Mesh {
    let offset = a.vertices.len() as u32;
    let mut both = a.clone();
    both.vertices.extend_from_slice(&b.vertices);
    both.triangles.extend(b.triangles.iter().map(|t| t.map(|v| v + offset)));
    both
}
