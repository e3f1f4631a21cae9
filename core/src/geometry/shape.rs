//! Boxes, cylinders and spheres, and the distance between two of them.

use super::surface::parry_pose;
use super::{Aabb, Pose, Vec3};
use nalgebra::{Translation3, UnitQuaternion};
use parry3d_f64::math::Vector;
use parry3d_f64::query;
use parry3d_f64::shape::{Ball, Cuboid, Cylinder, Shape as ParryShape};

/// A convex body about the origin of its own frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A box.
    Box {
        /// Half of its edges, metres.
        half: Vec3,
    },
    /// A cylinder along z.
    Cylinder {
        /// Metres.
        radius: f64,
        /// Half of its length, metres.
        half_length: f64,
    },
    /// A sphere.
    Sphere {
        /// Metres.
        radius: f64,
    },
}

impl Shape {
    /// Radius of the smallest sphere about the origin that contains the body, metres.
    pub fn bounding_radius(&self) -> f64 {
        match *self {
            Shape::Box { half } => half.norm(),
            Shape::Cylinder { radius, half_length } => radius.hypot(half_length),
            Shape::Sphere { radius } => radius,
        }
    }

    /// Distance of a point of the body's frame to the body, metres; 0 inside.
    pub fn distance(&self, point: &Vec3) -> f64 {
        match *self {
            Shape::Box { half } => (point.abs() - half).sup(&Vec3::zeros()).norm(),
            Shape::Cylinder { radius, half_length } => {
                let side = (point.x.hypot(point.y) - radius).max(0.0);
                side.hypot((point.z.abs() - half_length).max(0.0))
            }
            Shape::Sphere { radius } => (point.norm() - radius).max(0.0),
        }
    }

    /// The box round the body in the frame `frame_from_shape` leads to.
    pub fn aabb(&self, frame_from_shape: &Pose) -> Aabb {
        let half = match *self {
            Shape::Box { half } => half,
            Shape::Cylinder { radius, half_length } => Vec3::new(radius, radius, half_length),
            Shape::Sphere { radius } => Vec3::repeat(radius),
        };
        let turn = frame_from_shape.rotation.to_rotation_matrix().into_inner().abs();
        let half = if let Shape::Sphere { .. } = self { half } else { turn * half };
        let middle = frame_from_shape.translation.vector;
        Aabb { min: middle - half, max: middle + half }
    }
}

/// A shape fixed to a frame, ready for distances.
#[derive(Clone, Debug)]
pub(crate) struct Solid {
    body: Body,
    /// From the body as parry3d wants it (cylinders along y) to the frame.
    frame_from_body: Pose,
    radius: f64,
}

#[derive(Clone, Debug)]
enum Body {
    Cuboid(Cuboid),
    Cylinder(Cylinder),
    Ball(Ball),
}

impl Solid {
    pub(crate) fn new(shape: &Shape, frame_from_shape: &Pose) -> Solid {
        let (body, turn) = match *shape {
            Shape::Box { half } => {
                let cuboid = Cuboid::new(Vector::new(half.x, half.y, half.z));
                (Body::Cuboid(cuboid), UnitQuaternion::identity())
            }
            Shape::Cylinder { radius, half_length } => {
                let turn =
                    UnitQuaternion::from_axis_angle(&Vec3::x_axis(), std::f64::consts::FRAC_PI_2);
                (Body::Cylinder(Cylinder::new(half_length, radius)), turn)
            }
            Shape::Sphere { radius } => (Body::Ball(Ball::new(radius)), UnitQuaternion::identity()),
        };
        let turn = Pose::from_parts(Translation3::identity(), turn);
        Solid { body, frame_from_body: frame_from_shape * turn, radius: shape.bounding_radius() }
    }

    /// Radius of the sphere about the body's middle that contains it, metres.
    pub(crate) fn bounding_radius(&self) -> f64 {
        self.radius
    }

    /// Where the body is when its frame is at `a_from_frame`.
    pub(crate) fn body_pose(&self, a_from_frame: &Pose) -> Pose {
        a_from_frame * self.frame_from_body
    }

    /// Distance of the farthest point of the body from the frame's origin, at most, metres.
    pub(crate) fn max_reach(&self) -> f64 {
        self.frame_from_body.translation.vector.norm() + self.radius
    }

    /// Distance between two placed bodies (see [`Solid::place`]), metres; 0 if they overlap.
    pub(crate) fn separation(&self, place: &Pose, other: &Solid, other_place: &Pose) -> f64 {
        let (a, b) = (parry_pose(place), parry_pose(other_place));
        // An unsupported pair is impossible: any two of these convex shapes have a distance.
        query::distance(&a, self.shape(), &b, other.shape()).map_or(0.0, |d| d.distance)
    }

    fn shape(&self) -> &dyn ParryShape {
        match &self.body {
            Body::Cuboid(cuboid) => cuboid,
            Body::Cylinder(cylinder) => cylinder,
            Body::Ball(ball) => ball,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Twist, exp, transform};

    fn shapes() -> [Shape; 3] {
        [
            Shape::Box { half: Vec3::new(0.1, 0.2, 0.3) },
            Shape::Cylinder { radius: 0.1, half_length: 0.4 },
            Shape::Sphere { radius: 0.2 },
        ]
    }

    #[test]
    fn separation_from_a_tiny_sphere_is_the_distance_of_the_point() {
        let dot = Shape::Sphere { radius: 1e-9 };
        let pose = exp(&Twist::new(0.3, -0.2, 0.5, 0.4, -0.9, 0.2));
        for shape in shapes() {
            let solid = Solid::new(&shape, &pose);
            for i in 0..50 {
                let t = f64::from(i);
                let point = Vec3::new((t * 1.3).sin(), (t * 0.7).cos(), (t * 2.1).sin());
                let at = Pose::translation(point.x, point.y, point.z);
                let there = Solid::new(&dot, &Pose::identity());
                let found = solid.separation(
                    &solid.body_pose(&Pose::identity()),
                    &there,
                    &there.body_pose(&at),
                );
                let expected = shape.distance(&pose.inverse_transform_point(&point.into()).coords);
                assert!((found - expected).abs() < 1e-5, "{shape:?}: {found} {expected}");
            }
        }
    }

    #[test]
    fn the_box_and_sphere_of_a_turned_body_contain_its_points() {
        let pose = exp(&Twist::new(0.3, -0.2, 0.5, 0.4, -0.9, 0.2));
        for shape in shapes() {
            let aabb = shape.aabb(&pose).padded(1e-12);
            let unit = shape.aabb(&Pose::identity()).max;
            for i in 0..1000 {
                let t = f64::from(i);
                let point =
                    Vec3::new(t.sin(), (1.7 * t).cos(), (2.3 * t).sin()).component_mul(&unit);
                if shape.distance(&point) == 0.0 {
                    assert!(aabb.contains(&transform(&pose, &point)), "{shape:?} {point}");
                    assert!(point.norm() <= shape.bounding_radius() + 1e-12, "{shape:?} {point}");
                }
            }
        }
    }

    #[test]
    fn overlapping_bodies_have_no_distance_and_lying_apart_they_have_the_gap() {
        let pose = Pose::translation(0.0, 0.0, 0.9);
        for a in shapes() {
            let top = a.aabb(&Pose::identity()).max.z;
            for b in shapes() {
                let (a, b_solid) =
                    (Solid::new(&a, &Pose::identity()), Solid::new(&b, &Pose::identity()));
                let gap = 0.9 - top - b.aabb(&Pose::identity()).max.z;
                let place = a.body_pose(&Pose::identity());
                let found = a.separation(&place, &b_solid, &b_solid.body_pose(&pose));
                assert!((found - gap.max(0.0)).abs() < 1e-6, "{found} {gap}");
                let found = a.separation(&place, &b_solid, &b_solid.body_pose(&Pose::identity()));
                assert_eq!(found, 0.0);
            }
        }
    }
}
