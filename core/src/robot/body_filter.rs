//! Which measured points lie on the robot itself or on other known bodies.

use crate::geometry::{Pose, Shape, Vec3, transform};
use rayon::prelude::*;

/// Points that one thread takes at least; fewer do not repay handing them over.
const MIN_POINTS_PER_THREAD: usize = 4096;

/// Marks measured points that lie on known bodies.
#[derive(Clone, Debug)]
pub struct BodyFilter {
    bodies: Vec<PlacedBody>,
    margin: f64,
}

#[derive(Clone, Debug)]
struct PlacedBody {
    shape: Shape,
    shape_from_frame: Pose,
    center: Vec3,
    /// Square of the distance from the centre beyond which no point lies on the body.
    max_squared_distance: f64,
}

impl BodyFilter {
    /// A filter for bodies at poses `frame_from_shape`, each grown by `margin` metres.
    pub fn new(bodies: &[(Shape, Pose)], margin: f64) -> BodyFilter {
        let bodies = bodies
            .iter()
            .map(|(shape, pose)| PlacedBody {
                shape: *shape,
                shape_from_frame: pose.inverse(),
                center: pose.translation.vector,
                max_squared_distance: (shape.bounding_radius() + margin).powi(2),
            })
            .collect();
        BodyFilter { bodies, margin }
    }

    /// Whether each point (frame of the bodies, metres) lies on or in a body; a point that is NaN
    /// does not.
    pub fn mask_on_bodies(&self, points: &[Vec3]) -> Vec<bool> {
        points
            .par_iter()
            .with_min_len(MIN_POINTS_PER_THREAD)
            .map(|point| self.is_on_body(point))
            .collect()
    }

    fn is_on_body(&self, point: &Vec3) -> bool {
        self.bodies.iter().any(|body| {
            (point - body.center).norm_squared() <= body.max_squared_distance
                && body.shape.distance(&transform(&body.shape_from_frame, point)) <= self.margin
        })
    }
}
