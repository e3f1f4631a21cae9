//! Points, poses, boxes, clouds, bodies and the searches over them; sensor and noise models.

mod aabb;
mod cloud;
mod kdtree;
mod noise_model;
mod plane_fit;
mod pose;
mod sensor;
mod shape;
mod statistics;
mod surface;

pub use aabb::Aabb;
pub use cloud::{Cloud, Scan};
pub use kdtree::KdTree;
pub(crate) use noise_model::MIN_INCIDENCE_COS;
pub use noise_model::{
    Excess, Misfit, NoiseComponents, NoiseModel, RangeResidual, ResidualMoments, ScanResiduals,
};
pub use plane_fit::{PlaneFit, any_orthogonal, fit_plane};
pub use pose::{
    Mat6, Pose, Twist, adjoint, exp, log, pose_from_rows, pose_to_rows, rigid_fit, skew, transform,
};
pub use sensor::{SensorModel, SensorRay, StereoModel, StriperModel};
pub use shape::Shape;
pub(crate) use shape::Solid;
pub(crate) use statistics::{MAD_TO_SIGMA, TUKEY_CUTOFF_SIGMA, median};
pub use surface::{Projection, Surface};

/// A point or vector, metres.
pub type Vec3 = nalgebra::Vector3<f64>;
/// A 3 x 3 matrix.
pub type Mat3 = nalgebra::Matrix3<f64>;
