//! Rays into the simulated scene.

use super::labels::{GOOD_LABEL, SURROUNDINGS_LABEL};
use crate::Result;
use crate::geometry::{Aabb, Pose, Surface, Vec3, transform};
use crate::mesh::Mesh;

/// A surface hides a point only if it is nearer than the point by more than this, metres: above
/// rounding, below the thickness of any wall.
const OCCLUSION_TOLERANCE: f64 = 1e-5;

/// The object and its surroundings, prepared for rays.
pub(crate) struct SimulatedScene {
    surface: Surface,
    normals: Vec<Vec3>,
    /// Bounding box of the object, object frame, metres.
    pub aabb: Aabb,
    /// Bounding box of the object and its surroundings, object frame, metres.
    bounds: Aabb,
    /// Number of the object's triangles, which come before those of its surroundings.
    object_triangles: usize,
}

/// Where a ray met the scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    /// The point, sensor frame, metres.
    pub point: Vec3,
    /// Cosine of the angle of incidence, between the ray and the surface's normal.
    pub cosine: f64,
    /// Depth as the sensor measures it (along the ray or along z), metres.
    pub depth: f64,
    /// Whether the object was met, not its surroundings.
    pub on_object: bool,
}

impl Hit {
    /// The label of a point without other faults.
    pub(crate) fn label(&self) -> u8 {
        if self.on_object { GOOD_LABEL } else { SURROUNDINGS_LABEL }
    }
}

impl SimulatedScene {
    /// Builds the scene of `truth` and its `surroundings` (object frame), which may be empty.
    ///
    /// # Errors
    /// As [`Surface::new`].
    pub(crate) fn new(truth: &Mesh, surroundings: &Mesh) -> Result<SimulatedScene> {
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
        let object_triangles = truth.triangles.len();
        Ok(SimulatedScene { surface, normals, aabb, bounds, object_triangles })
    }

    /// Half the diagonal of the object's box, metres.
    pub(crate) fn radius(&self) -> f64 {
        self.aabb.diagonal() / 2.0
    }

    /// The first point on the ray from `origin` along the unit vector `direction` that is also
    /// visible from `second_eye` (all in the sensor frame, metres); `None` if there is none or it
    /// is hidden from there. The `depth` of the hit is the length of the ray.
    pub(crate) fn cast_ray_seen_by_both(
        &self,
        object_from_sensor: &Pose,
        origin: &Vec3,
        direction: &Vec3,
        second_eye: &Vec3,
    ) -> Option<Hit> {
        let from = transform(object_from_sensor, origin);
        let along = object_from_sensor.rotation * direction;
        let reach = (from - self.bounds.center()).norm() + self.bounds.diagonal() / 2.0;
        let (depth, triangle) = self.surface.cast_ray(&from, &along, reach)?;
        let normal = &self.normals[triangle];
        let cosine = -along.dot(normal);
        let second_eye = transform(object_from_sensor, second_eye);
        let is_seen = cosine > 0.0 && self.is_visible(&second_eye, &(from + along * depth), normal);
        is_seen.then(|| Hit {
            point: origin + direction * depth,
            cosine,
            depth,
            on_object: triangle < self.object_triangles,
        })
    }

    /// Whether a surface point with its normal faces `eye` and nothing lies in between (object
    /// frame).
    fn is_visible(&self, eye: &Vec3, point: &Vec3, normal: &Vec3) -> bool {
        let sight = point - eye;
        let distance = sight.norm();
        sight.dot(normal) < 0.0
            && self
                .surface
                .cast_ray(eye, &(sight / distance), distance - OCCLUSION_TOLERANCE)
                .is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_shapes::cuboid;

    /// A cube of 0.1 m round the origin on a table of 2 x 2 m.
    fn scene() -> SimulatedScene {
        let cube = cuboid(Vec3::repeat(-0.05), Vec3::repeat(0.05));
        let table = cuboid(Vec3::new(-1.0, -1.0, -0.09), Vec3::new(1.0, 1.0, -0.05));
        SimulatedScene::new(&cube, &table).unwrap()
    }

    #[test]
    fn rays_meet_object_and_surroundings_at_hand_computed_points() {
        let scene = scene();
        assert!((scene.radius() - 0.05 * 3f64.sqrt()).abs() < 1e-12);
        // In the sensor frame z points down: the sensor is 0.5 m above the origin.
        let down = nalgebra::UnitQuaternion::from_axis_angle(&Vec3::x_axis(), std::f64::consts::PI);
        let pose = Pose::from_parts(nalgebra::Translation3::new(0.0, 0.0, 0.5), down);
        let eye = Vec3::zeros();
        let hit = scene.cast_ray_seen_by_both(&pose, &eye, &Vec3::z(), &eye).unwrap();
        assert!((hit.point - Vec3::z() * 0.45).norm() < 1e-9 && hit.on_object);
        assert!((hit.cosine - 1.0).abs() < 1e-9 && (hit.depth - 0.45).abs() < 1e-9);
        // At 45 degrees the table is met beside the cube.
        let slanted = Vec3::new(1.0, 0.0, 1.0).normalize();
        let hit = scene.cast_ray_seen_by_both(&pose, &eye, &slanted, &eye).unwrap();
        assert!((hit.point - Vec3::new(0.55, 0.0, 0.55)).norm() < 1e-9, "{:?}", hit.point);
        assert_eq!((hit.on_object, hit.label()), (false, SURROUNDINGS_LABEL));
        assert!((hit.cosine - 0.5f64.sqrt()).abs() < 1e-9);
        // Past the edge of the table there is nothing.
        let flat = Vec3::new(1.0, 0.0, 0.4).normalize();
        assert!(scene.cast_ray_seen_by_both(&pose, &eye, &flat, &eye).is_none());
        // A second eye behind the cube does not see the table in front of it.
        let behind = Vec3::new(-0.5, 0.0, 0.49);
        assert!(scene.cast_ray_seen_by_both(&pose, &eye, &slanted, &behind).is_none());
    }
}
