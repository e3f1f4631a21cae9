//! The robot's bodies as triangles.

use super::OBJECT_FRAME;
use super::model::RobotModel;
use crate::Result;
use crate::geometry::{Pose, Shape, Vec3};
use crate::mesh::Mesh;
use std::f64::consts::{PI, TAU};

/// Corners of a cylinder's rim, and of a sphere's equator.
const CORNERS: u32 = 48;

impl RobotModel {
    /// The collision bodies of some links at `q` as closed triangle meshes in the object frame, metres.
    ///
    /// # Errors
    /// [`crate::Error::Input`] if a link or the object frame is missing, or `q` does not fit the joints.
    pub fn shapes_mesh(&self, links: &[&str], q: &[f64]) -> Result<Mesh> {
        self.check(q)?;
        let poses = self.forward(q);
        let object_from_root = poses[self.link(OBJECT_FRAME)?].inverse();
        let mut mesh = Mesh::default();
        for name in links {
            let link = self.link(name)?;
            for body in self.shapes.iter().filter(|s| s.link == link) {
                let pose = object_from_root * poses[link] * body.link_from_shape;
                add(&mut mesh, &triangulated(&body.shape), &pose);
            }
        }
        Ok(mesh)
    }
}

fn add(mesh: &mut Mesh, part: &Mesh, pose: &Pose) {
    let offset = mesh.vertices.len() as u32;
    let place = |v: &Vec3| (pose * nalgebra::Point3::from(*v)).coords;
    mesh.vertices.extend(part.vertices.iter().map(place));
    mesh.triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + offset)));
}

/// A closed mesh of the body in its own frame.
fn triangulated(shape: &Shape) -> Mesh {
    match *shape {
        Shape::Box { half } => cuboid(&half),
        Shape::Cylinder { radius, half_length } => turned(&[
            (0.0, -half_length),
            (radius, -half_length),
            (radius, half_length),
            (0.0, half_length),
        ]),
        Shape::Sphere { radius } => {
            let rings = CORNERS / 2;
            let profile: Vec<(f64, f64)> = (0..=rings)
                .map(|i| PI * f64::from(i) / f64::from(rings))
                .map(|angle| (radius * angle.sin(), -radius * angle.cos()))
                .collect();
            turned(&profile)
        }
    }
}

fn cuboid(half: &Vec3) -> Mesh {
    let corner = |i: u32| {
        let sign = |bit: u32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
        half.component_mul(&Vec3::new(sign(0), sign(1), sign(2)))
    };
    let triangles = (0..3u32).flat_map(|axis| {
        let [u, v, w] = [1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3), 1 << axis];
        [[0, v, u + v], [0, u + v, u], [w, w + u, w + u + v], [w, w + u + v, w + v]]
    });
    Mesh::new((0..8).map(corner).collect(), triangles.collect())
}

/// The body that a profile (radius, height) sweeps about z; the profile rises from the axis to the axis.
fn turned(profile: &[(f64, f64)]) -> Mesh {
    let mut mesh = Mesh::default();
    let inner = &profile[1..profile.len() - 1];
    for (radius, z) in inner {
        for i in 0..CORNERS {
            let angle = TAU * f64::from(i) / f64::from(CORNERS);
            mesh.vertices.push(Vec3::new(radius * angle.cos(), radius * angle.sin(), *z));
        }
    }
    let (bottom, top) = (mesh.vertices.len() as u32, mesh.vertices.len() as u32 + 1);
    mesh.vertices.push(Vec3::new(0.0, 0.0, profile[0].1));
    mesh.vertices.push(Vec3::new(0.0, 0.0, profile[profile.len() - 1].1));
    let last = (inner.len() as u32 - 1) * CORNERS;
    for i in 0..CORNERS {
        let next = (i + 1) % CORNERS;
        mesh.triangles.push([bottom, next, i]);
        for ring in (0..last).step_by(CORNERS as usize) {
            let [a, b, c, d] = [ring + i, ring + next, ring + CORNERS + next, ring + CORNERS + i];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
        mesh.triangles.push([top, last + i, last + next]);
    }
    mesh
}
