//! Points, poses, boxes, clouds and the searches over them.

mod aabb;
mod cloud;
mod fit;
mod kdtree;
mod median;
mod noise;
mod pose;
mod sensor;
mod shape;
mod surface;

pub use aabb::Aabb;
pub use cloud::{Cloud, Scan};
pub use fit::{PlaneFit, any_orthogonal, fit_plane};
pub use kdtree::KdTree;
pub(crate) use median::{MAD_TO_SIGMA, median};
pub use noise::{Components, Moments, NoiseModel, Residual};
pub use pose::{
    Mat6, Pose, Twist, adjoint, exp, log, pose_from_rows, pose_to_rows, rigid_fit, skew,
};
pub use sensor::{SensorModel, SensorRay, StereoModel, StriperModel};
pub use shape::Shape;
pub(crate) use shape::Solid;
pub use surface::{Projection, Surface};

/// A point or vector, metres.
pub type Vec3 = nalgebra::Vector3<f64>;
/// A 3 x 3 matrix.
pub type Mat3 = nalgebra::Matrix3<f64>;
