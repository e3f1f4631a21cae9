//! Which measured points lie on the robot itself.

use crate::geometry::{Pose, Shape, Vec3};
use rayon::prelude::*;

/// Bodies that points are held against.
#[derive(Clone, Debug)]
pub struct BodyFilter {
    bodies: Vec<Placed>,
    margin: f64,
}

#[derive(Clone, Debug)]
struct Placed {
    shape: Shape,
    shape_from_frame: Pose,
    middle: Vec3,
    /// Square of the radius beyond which no point can lie on the body.
    far: f64,
}

impl BodyFilter {
    /// Of bodies at poses `frame_from_shape`, each grown by `margin` metres.
    pub fn new(bodies: &[(Shape, Pose)], margin: f64) -> BodyFilter {
        let place = |(shape, pose): &(Shape, Pose)| Placed {
            shape: *shape,
            shape_from_frame: pose.inverse(),
            middle: pose.translation.vector,
            far: (shape.radius() + margin).powi(2),
        };
        BodyFilter { bodies: bodies.iter().map(place).collect(), margin }
    }

    /// Whether each point of the frame lies on or in a body; a point that is no number does not.
    pub fn on_body(&self, points: &[Vec3]) -> Vec<bool> {
        points.par_iter().with_min_len(4096).map(|point| self.holds(point)).collect()
    }

    fn holds(&self, point: &Vec3) -> bool {
        self.bodies.iter().any(|body| {
            (point - body.middle).norm_squared() <= body.far
                && body
                    .shape
                    .distance(&(body.shape_from_frame * nalgebra::Point3::from(*point)).coords)
                    <= self.margin
        })
    }
}
