//! The collision bodies of the robot as triangle meshes.

use super::frames::OBJECT_FRAME;
use super::model::RobotModel;
use crate::Result;
use crate::geometry::{Pose, Shape, Vec3, transform};
use crate::mesh::Mesh;
use std::f64::consts::{PI, TAU};

/// Number of vertices on the rim of a cylinder and on the equator of a sphere.
const CIRCLE_SEGMENTS: u32 = 48;

impl RobotModel {
    /// The collision bodies of some links at the joint positions `q` as closed triangle meshes in
    /// the object frame, metres.
    ///
    /// # Errors
    /// [`crate::Error::Input`] if a link or the object frame is missing, or `q` does not fit the
    /// joints.
    pub fn link_shapes_mesh(&self, links: &[&str], q: &[f64]) -> Result<Mesh> {
        self.check_configuration(q)?;
        let poses = self.forward_kinematics(q);
        let object_from_root = poses[self.link(OBJECT_FRAME)?].inverse();
        let mut mesh = Mesh::default();
        for name in links {
            let link = self.link(name)?;
            for body in self.shapes.iter().filter(|s| s.link == link) {
                let pose = object_from_root * poses[link] * body.link_from_shape;
                append_mesh(&mut mesh, &triangulate(&body.shape), &pose);
            }
        }
        Ok(mesh)
    }
}

/// Appends `part`, whose frame has the given pose in the frame of `mesh`.
fn append_mesh(mesh: &mut Mesh, part: &Mesh, pose: &Pose) {
    let offset = mesh.vertices.len() as u32;
    mesh.vertices.extend(part.vertices.iter().map(|v| transform(pose, v)));
    mesh.triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + offset)));
}

/// A closed mesh of the body in its own frame.
fn triangulate(shape: &Shape) -> Mesh {
    match *shape {
        Shape::Box { half } => triangulate_box(&half),
        Shape::Cylinder { radius, half_length } => revolve_profile(&[
            (0.0, -half_length),
            (radius, -half_length),
            (radius, half_length),
            (0.0, half_length),
        ]),
        Shape::Sphere { radius } => {
            let rings = CIRCLE_SEGMENTS / 2;
            let profile: Vec<(f64, f64)> = (0..=rings)
                .map(|i| PI * f64::from(i) / f64::from(rings))
                .map(|angle| (radius * angle.sin(), -radius * angle.cos()))
                .collect();
            revolve_profile(&profile)
        }
    }
}

/// A box round the origin with half edges `half`. Bit 0, 1 and 2 of a vertex's index say whether it
/// lies on the positive side along x, y and z.
fn triangulate_box(half: &Vec3) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..8u32 {
        let signs = [0, 1, 2].map(|bit| if i >> bit & 1 == 1 { 1.0 } else { -1.0 });
        mesh.vertices.push(half.component_mul(&Vec3::from(signs)));
    }
    for axis in 0..3u32 {
        let [u, v, w] = [1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3), 1 << axis];
        mesh.triangles.extend([[0, v, u + v], [0, u + v, u]]);
        mesh.triangles.extend([[w, w + u, w + u + v], [w, w + u + v, w + v]]);
    }
    mesh
}

/// The closed surface that a profile of points (radius, height) sweeps about z. The profile rises
/// from a point on the axis to another.
fn revolve_profile(profile: &[(f64, f64)]) -> Mesh {
    let mut mesh = Mesh::default();
    let inner = &profile[1..profile.len() - 1];
    for (radius, z) in inner {
        for i in 0..CIRCLE_SEGMENTS {
            let angle = TAU * f64::from(i) / f64::from(CIRCLE_SEGMENTS);
            mesh.vertices.push(Vec3::new(radius * angle.cos(), radius * angle.sin(), *z));
        }
    }
    let (bottom, top) = (mesh.vertices.len() as u32, mesh.vertices.len() as u32 + 1);
    mesh.vertices.push(Vec3::new(0.0, 0.0, profile[0].1));
    mesh.vertices.push(Vec3::new(0.0, 0.0, profile[profile.len() - 1].1));
    let last_ring = (inner.len() as u32 - 1) * CIRCLE_SEGMENTS;
    for i in 0..CIRCLE_SEGMENTS {
        let next = (i + 1) % CIRCLE_SEGMENTS;
        mesh.triangles.push([bottom, next, i]);
        for ring in (0..last_ring).step_by(CIRCLE_SEGMENTS as usize) {
            let above = ring + CIRCLE_SEGMENTS;
            let [a, b, c, d] = [ring + i, ring + next, above + next, above + i];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
        mesh.triangles.push([top, last_ring + i, last_ring + next]);
    }
    mesh
}
