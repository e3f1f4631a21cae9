//! Searches over the triangles of a fixed surface. Only this file and `shape.rs` know parry3d's
//! types.

use super::{Aabb, Pose, Vec3};
use crate::{Error, Result};
use parry3d_f64::bounding_volume::Aabb as ParryAabb;
use parry3d_f64::math::{Pose as ParryPose, Rotation, Vector};
use parry3d_f64::query::{PointQuery, PointQueryWithLocation, Ray, RayCast};
use parry3d_f64::shape::TriMesh;

/// Triangles in a bounding-volume hierarchy.
///
/// ```
/// use puffer_core::geometry::{Surface, Vec3};
///
/// let corners = [Vec3::zeros(), Vec3::x(), Vec3::y()];
/// let surface = Surface::new(&corners, &[[0, 1, 2]])?;
/// assert_eq!(surface.distance(&Vec3::new(0.2, 0.2, 0.5)), 0.5);
/// let hit = surface.cast_ray(&Vec3::new(0.2, 0.2, 2.0), &-Vec3::z(), 5.0);
/// assert_eq!(hit, Some((2.0, 0)));
/// # Ok::<(), puffer_core::Error>(())
/// ```
pub struct Surface {
    mesh: TriMesh,
}

/// The point of a surface nearest to a query.
#[derive(Clone, Copy, Debug)]
pub struct Projection {
    /// The nearest point, metres.
    pub point: Vec3,
    /// Its distance to the query, metres.
    pub distance: f64,
    /// The triangle that it lies on.
    pub triangle: usize,
}

impl Surface {
    /// Builds the hierarchy over `triangles`, which index `vertices` (metres).
    ///
    /// # Errors
    /// [`Error::Input`] if there is no triangle.
    pub fn new(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Result<Surface> {
        let points = vertices.iter().map(to_parry).collect();
        let mesh = TriMesh::new(points, triangles.to_vec())
            .map_err(|e| Error::input(format!("the surface has no usable triangle: {e}")))?;
        Ok(Surface { mesh })
    }

    /// The nearest point of the surface.
    pub fn project(&self, query: &Vec3) -> Projection {
        let (projection, (triangle, _)) =
            self.mesh.project_local_point_and_get_location(to_parry(query), false);
        let point = from_parry(projection.point);
        Projection { point, distance: (point - query).norm(), triangle: triangle as usize }
    }

    /// The distance to the nearest point of the surface, metres.
    pub fn distance(&self, query: &Vec3) -> f64 {
        self.mesh.distance_to_local_point(to_parry(query), false)
    }

    /// The first triangle that the ray from `origin` along the unit vector `direction` meets within
    /// `max_distance`: distance (metres) and triangle.
    pub fn cast_ray(
        &self,
        origin: &Vec3,
        direction: &Vec3,
        max_distance: f64,
    ) -> Option<(f64, usize)> {
        let ray = Ray::new(to_parry(origin), to_parry(direction));
        let hit = self.mesh.cast_local_ray_and_get_normal(&ray, max_distance, false)?;
        Some((hit.time_of_impact, hit.subshape as usize))
    }

    /// Indices of the triangles whose bounding boxes touch `aabb`, ascending.
    pub fn triangles_near(&self, aabb: &Aabb) -> Vec<u32> {
        let query = ParryAabb::new(to_parry(&aabb.min), to_parry(&aabb.max));
        let mut found: Vec<u32> = self.mesh.bvh().intersect_aabb(&query).collect();
        found.sort_unstable();
        found
    }
}

fn to_parry(v: &Vec3) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

pub(super) fn parry_pose(pose: &Pose) -> ParryPose {
    let q = &pose.rotation;
    let rotation = Rotation::from_xyzw(q.i, q.j, q.k, q.w);
    ParryPose { rotation, translation: to_parry(&pose.translation.vector) }
}

fn from_parry(v: Vector) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five parallel triangles at z = 0, 1, ... 4, facing upwards.
    fn stacked_triangles() -> Surface {
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        let vertices: Vec<Vec3> = (0..15)
            .map(|i| Vec3::new(corners[i % 3][0], corners[i % 3][1], (i / 3) as f64))
            .collect();
        let triangles: Vec<[u32; 3]> = (0..5).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Surface::new(&vertices, &triangles).unwrap()
    }

    #[test]
    fn the_nearest_point_lies_inside_on_an_edge_or_at_a_corner() {
        let surface = stacked_triangles();
        for (query, expected) in [
            (Vec3::new(0.2, 0.3, 2.4), Vec3::new(0.2, 0.3, 2.0)),
            (Vec3::new(0.4, -1.0, 3.0), Vec3::new(0.4, 0.0, 3.0)),
            (Vec3::new(2.0, -1.0, 5.0), Vec3::new(1.0, 0.0, 4.0)),
        ] {
            let found = surface.project(&query);
            assert!((found.point - expected).norm() < 1e-12, "{query}");
            assert!((found.distance - (query - expected).norm()).abs() < 1e-12, "{query}");
            assert_eq!(found.triangle, expected.z as usize);
            assert!((surface.distance(&query) - found.distance).abs() < 1e-12);
        }
    }

    #[test]
    fn triangles_near_a_box_are_those_whose_boxes_touch_it() {
        let aabb = Aabb { min: Vec3::new(0.4, 0.4, 0.5), max: Vec3::new(2.0, 2.0, 2.5) };
        assert_eq!(stacked_triangles().triangles_near(&aabb), [1, 2]);
        assert!(Surface::new(&[], &[]).is_err());
    }

    #[test]
    fn a_ray_names_the_triangle_that_it_meets_first() {
        let surface = stacked_triangles();
        for (z, direction, expected) in
            [(2.5, Vec3::z(), (0.5, 3)), (2.25, -Vec3::z(), (0.25, 2)), (9.0, -Vec3::z(), (5.0, 4))]
        {
            let hit = surface.cast_ray(&Vec3::new(0.2, 0.2, z), &direction, 10.0);
            assert_eq!(hit, Some(expected));
        }
        assert!(surface.cast_ray(&Vec3::new(0.2, 0.2, 9.0), &-Vec3::z(), 4.9).is_none());
    }
}
