//! From a solid's distance field to a fine mesh whose vertices lie on its surface.

use super::sdf::Field;
use crate::geometry::{Aabb, Vec3};
use crate::mesh::Mesh;
use crate::mesh::isosurface::Lattice;
use rayon::prelude::*;

/// Rounds of relaxation. Six take the slivers of the lattice away; more gain little.
const ROUNDS: usize = 6;
/// How often a move that spoils a triangle is halved before it is given up.
const HALVINGS: usize = 3;
/// Newton steps of each vertex towards the zero set; blends need two or three.
const NEWTON_STEPS: usize = 4;
/// Half the step of the numeric gradient, millimetres.
const GRADIENT_STEP: f64 = 1e-4;

/// The zero set of `field` within a box of `size` round the z axis above z = 0 (all millimetres), sampled at
/// `spacing`, its vertices moved onto the zero set and evened out along it. Vertices in millimetres.
pub(crate) fn mesh(field: Field, size: [f64; 3], spacing: f64) -> Mesh {
    let half = Vec3::new(size[0] / 2.0, size[1] / 2.0, 0.0);
    let aabb = Aabb { min: -half, max: half + Vec3::z() * size[2] }.padded(2.37 * spacing);
    let mut mesh = Lattice::sample(&aabb, spacing, field).surface();
    let onto = |v: &Vec3| onto_surface(field, v, spacing);
    let targets = mesh.vertices.par_iter().map(onto).collect();
    move_guarded(&mut mesh, targets);
    let neighbours = neighbours(&mesh);
    for _ in 0..ROUNDS {
        let relaxed = |(v, around): (&Vec3, &Vec<u32>)| {
            let sum: Vec3 = around.iter().map(|&i| mesh.vertices[i as usize]).sum();
            let normal = gradient(field, v).try_normalize(0.0).unwrap_or_else(Vec3::zeros);
            let shift = (sum / around.len() as f64 - v) * 0.5;
            onto(&(v + shift - normal * shift.dot(&normal)))
        };
        let targets = mesh.vertices.par_iter().zip(&neighbours).map(relaxed).collect();
        move_guarded(&mut mesh, targets);
    }
    mesh
}

fn gradient(field: Field, p: &Vec3) -> Vec3 {
    let slope = |axis: usize| {
        let step = Vec3::ith(axis, GRADIENT_STEP);
        (field(&(p + step)) - field(&(p - step))) / (2.0 * GRADIENT_STEP)
    };
    Vec3::new(slope(0), slope(1), slope(2))
}

/// Newton steps along the gradient; stays where it is if they would lead farther than `reach`.
fn onto_surface(field: Field, start: &Vec3, reach: f64) -> Vec3 {
    let mut p = *start;
    for _ in 0..NEWTON_STEPS {
        let slope = gradient(field, &p);
        p -= slope * (field(&p) / slope.norm_squared().max(0.1));
    }
    if (p - start).norm() <= reach { p } else { *start }
}

/// The vertices that share an edge with each vertex, ascending.
fn neighbours(mesh: &Mesh) -> Vec<Vec<u32>> {
    let mut neighbours = vec![Vec::with_capacity(8); mesh.vertices.len()];
    for t in &mesh.triangles {
        for i in 0..3 {
            // Each edge of a closed mesh is walked once in each direction.
            neighbours[t[i] as usize].push(t[(i + 1) % 3]);
        }
    }
    neighbours.iter_mut().for_each(|around| around.sort_unstable());
    neighbours
}

/// Moves the vertices to `targets`, but shortens or gives up those moves that would turn a triangle by more
/// than 60 degrees or make it less than a tenth of its longest edge high and lower than it was.
fn move_guarded(mesh: &mut Mesh, mut targets: Vec<Vec3>) {
    for round in 0.. {
        let spoilt = |t: &&[u32; 3]| {
            let before = t.map(|v| mesh.vertices[v as usize]);
            let after = t.map(|v| targets[v as usize]);
            let cosine = normal(&before).dot(&normal(&after));
            let height = |c: &[Vec3; 3]| doubled_area(c).norm() / longest_square(c);
            before != after && (cosine < 0.5 || height(&after) < height(&before).min(0.1))
        };
        let spoilt: Vec<[u32; 3]> = mesh.triangles.par_iter().filter(spoilt).copied().collect();
        if spoilt.is_empty() {
            break;
        }
        for v in spoilt.into_iter().flatten() {
            let (target, stay) = (&mut targets[v as usize], mesh.vertices[v as usize]);
            *target = if round < HALVINGS { (*target + stay) / 2.0 } else { stay };
        }
    }
    mesh.vertices = targets;
}

fn doubled_area([a, b, c]: &[Vec3; 3]) -> Vec3 {
    (b - a).cross(&(c - a))
}

fn normal(corners: &[Vec3; 3]) -> Vec3 {
    doubled_area(corners).try_normalize(0.0).unwrap_or_else(Vec3::zeros)
}

fn longest_square(corners: &[Vec3; 3]) -> f64 {
    (0..3).map(|i| (corners[i] - corners[(i + 1) % 3]).norm_squared()).fold(0.0, f64::max)
}
