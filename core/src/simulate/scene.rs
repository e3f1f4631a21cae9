//! Rays into the true object.

use super::labels::{GOOD, SURROUNDINGS};
use crate::Result;
use crate::geometry::{Aabb, Pose, Surface, Vec3};
use crate::mesh::Mesh;
use nalgebra::Point3;

/// How much nearer than the point an occluder must be, metres: above rounding, below any wall.
const CLEARANCE: f64 = 1e-5;

/// The object, ready for rays.
pub(crate) struct Scene {
    surface: Surface,
    normals: Vec<Vec3>,
    /// Bounding box of the object, object frame, metres.
    pub aabb: Aabb,
    /// Bounding box of the object and all round it, metres.
    bounds: Aabb,
    /// The object's triangles come first.
    of_object: usize,
}

/// Where a ray met the object.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    /// The point, sensor frame, metres.
    pub point: Vec3,
    /// Cosine of the angle between the ray and the surface's normal.
    pub cosine: f64,
    /// Depth as the sensor measures it (along the ray or along z), metres.
    pub depth: f64,
    /// Whether it is the object that was met, not what stands round it.
    pub on_object: bool,
}

impl Hit {
    /// The label of a point without other faults.
    pub(crate) fn label(&self) -> u8 {
        if self.on_object { GOOD } else { SURROUNDINGS }
    }
}

impl Scene {
    /// Builds the hierarchy over `truth` and its `surroundings` (object frame), which may be empty.
    ///
    /// # Errors
    /// As [`Surface::new`].
    pub(crate) fn new(truth: &Mesh, surroundings: &Mesh) -> Result<Scene> {
        let first = truth.vertices.len() as u32;
        let shifted = surroundings.triangles.iter().map(|t| t.map(|v| v + first));
        let mut all = Mesh {
            vertices: [&truth.vertices[..], &surroundings.vertices[..]].concat(),
            ..Mesh::default()
        };
        all.triangles = truth.triangles.iter().copied().chain(shifted).collect();
        let surface = Surface::new(&all.vertices, &all.triangles)?;
        let normals = (0..all.triangles.len()).map(|i| all.triangle_normal(i)).collect();
        let (aabb, bounds) = (truth.aabb(), all.aabb());
        Ok(Scene { surface, normals, aabb, bounds, of_object: truth.triangles.len() })
    }

    /// Half the diagonal of the object's box, metres.
    pub(crate) fn radius(&self) -> f64 {
        self.aabb.diagonal() / 2.0
    }

    /// The first point on the ray from `origin` along the unit `direction` that `witness` sees as well (all in
    /// the sensor frame); `None` if there is none or it is hidden from the witness. `depth` is the length of
    /// the ray.
    pub(crate) fn hit(
        &self,
        object_from_sensor: &Pose,
        origin: &Vec3,
        direction: &Vec3,
        witness: &Vec3,
    ) -> Option<Hit> {
        let place = |p: &Vec3| object_from_sensor.transform_point(&Point3::from(*p)).coords;
        let (from, along) = (place(origin), object_from_sensor.rotation * direction);
        let reach = (from - self.bounds.center()).norm() + self.bounds.diagonal() / 2.0;
        let (depth, triangle) = self.surface.cast_ray(&from, &along, reach)?;
        let normal = &self.normals[triangle];
        let cosine = -along.dot(normal);
        let seen = cosine > 0.0 && self.sees(&place(witness), &(from + along * depth), normal);
        seen.then(|| Hit {
            point: origin + direction * depth,
            cosine,
            depth,
            on_object: triangle < self.of_object,
        })
    }

    /// Whether nothing stands between `eye` and the surface point (object frame).
    fn sees(&self, eye: &Vec3, point: &Vec3, normal: &Vec3) -> bool {
        let sight = point - eye;
        let distance = sight.norm();
        sight.dot(normal) < 0.0
            && self.surface.cast_ray(eye, &(sight / distance), distance - CLEARANCE).is_none()
    }
}
