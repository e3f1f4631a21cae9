//! From a solid's distance field to a fine mesh whose vertices lie on its surface.

use super::sdf::Field;
use crate::geometry::{Aabb, Vec3};
use crate::mesh::Mesh;
use crate::mesh::isosurface::Lattice;
use rayon::prelude::*;

/// Rounds of relaxation. Six remove the slivers that the lattice leaves; more gain little.
const RELAXATION_ROUNDS: usize = 6;
/// How often a move that degrades a triangle is halved before it is given up.
const MAX_HALVINGS: usize = 3;
/// Newton steps of each vertex towards the zero set; blends need two or three.
const NEWTON_STEPS: usize = 4;
/// Half the step of the numeric gradient, millimetres.
const GRADIENT_STEP: f64 = 1e-4;
/// Least squared norm of the gradient in a Newton step: where it is smaller, at the ridge of a
/// blend, the step would be far too long.
const MIN_SQUARED_GRADIENT: f64 = 0.1;
/// Margin of the lattice round the object, in lattice spacings; not a whole number, so that no
/// vertex of the lattice lies on the object's flat faces.
const MARGIN_SPACINGS: f64 = 2.37;
/// A move may turn a triangle by at most 60 degrees.
const MIN_TURN_COS: f64 = 0.5;
/// A move may not lower a triangle whose height is less than this share of its longest edge.
const MIN_HEIGHT_RATIO: f64 = 0.1;

/// The zero set of `field` within a box of `size` round the z axis above z = 0 (all millimetres),
/// sampled at `spacing`, its vertices moved onto the zero set and evened out along it. Vertices in
/// millimetres.
pub(crate) fn mesh_zero_set(field: Field, size: [f64; 3], spacing: f64) -> Mesh {
    let half = Vec3::new(size[0] / 2.0, size[1] / 2.0, 0.0);
    let aabb =
        Aabb { min: -half, max: half + Vec3::z() * size[2] }.padded(MARGIN_SPACINGS * spacing);
    let mut mesh = Lattice::sample(&aabb, spacing, field).extract_isosurface();
    let targets = mesh.vertices.par_iter().map(|v| project_to_surface(field, v, spacing)).collect();
    move_guarded(&mut mesh, targets);
    let neighbours = list_neighbours(&mesh);
    for _ in 0..RELAXATION_ROUNDS {
        let targets = mesh
            .vertices
            .par_iter()
            .zip(&neighbours)
            .map(|(v, around)| {
                let sum: Vec3 = around.iter().map(|&i| mesh.vertices[i as usize]).sum();
                let normal = gradient(field, v).try_normalize(0.0).unwrap_or_else(Vec3::zeros);
                let shift = (sum / around.len() as f64 - v) * 0.5;
                let tangential = v + shift - normal * shift.dot(&normal);
                project_to_surface(field, &tangential, spacing)
            })
            .collect();
        move_guarded(&mut mesh, targets);
    }
    mesh
}

fn gradient(field: Field, p: &Vec3) -> Vec3 {
    Vec3::from_fn(|axis, _| {
        let step = Vec3::ith(axis, GRADIENT_STEP);
        (field(&(p + step)) - field(&(p - step))) / (2.0 * GRADIENT_STEP)
    })
}

/// The point moved onto the zero set by Newton steps along the gradient; it stays where it is if
/// they would lead farther than `reach`.
fn project_to_surface(field: Field, start: &Vec3, reach: f64) -> Vec3 {
    let mut p = *start;
    for _ in 0..NEWTON_STEPS {
        let slope = gradient(field, &p);
        p -= slope * (field(&p) / slope.norm_squared().max(MIN_SQUARED_GRADIENT));
    }
    if (p - start).norm() <= reach { p } else { *start }
}

/// The vertices that share an edge with each vertex, ascending.
fn list_neighbours(mesh: &Mesh) -> Vec<Vec<u32>> {
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

/// Moves the vertices to `targets`, but shortens or gives up those moves that would turn a triangle
/// by more than 60 degrees or make it less than a tenth of its longest edge high and lower than it
/// was.
fn move_guarded(mesh: &mut Mesh, mut targets: Vec<Vec3>) {
    for round in 0.. {
        let degraded: Vec<[u32; 3]> = mesh
            .triangles
            .par_iter()
            .filter(|t| {
                is_degraded(&t.map(|v| mesh.vertices[v as usize]), &t.map(|v| targets[v as usize]))
            })
            .copied()
            .collect();
        if degraded.is_empty() {
            break;
        }
        for v in degraded.into_iter().flatten() {
            let (target, stay) = (&mut targets[v as usize], mesh.vertices[v as usize]);
            *target = if round < MAX_HALVINGS { (*target + stay) / 2.0 } else { stay };
        }
    }
    mesh.vertices = targets;
}

/// Whether a move of the corners turns the triangle too far or makes it too low.
fn is_degraded(before: &[Vec3; 3], after: &[Vec3; 3]) -> bool {
    let cosine = normal(before).dot(&normal(after));
    before != after
        && (cosine < MIN_TURN_COS
            || height_ratio(after) < height_ratio(before).min(MIN_HEIGHT_RATIO))
}

/// Height of a triangle over its longest edge, as a share of that edge.
fn height_ratio(corners: &[Vec3; 3]) -> f64 {
    doubled_area(corners).norm() / longest_square(corners)
}

/// A vector along the normal, whose length is twice the triangle's area.
fn doubled_area([a, b, c]: &[Vec3; 3]) -> Vec3 {
    (b - a).cross(&(c - a))
}

fn normal(corners: &[Vec3; 3]) -> Vec3 {
    doubled_area(corners).try_normalize(0.0).unwrap_or_else(Vec3::zeros)
}

/// Square of the longest edge.
fn longest_square(corners: &[Vec3; 3]) -> f64 {
    (0..3).map(|i| (corners[i] - corners[(i + 1) % 3]).norm_squared()).fold(0.0, f64::max)
}
