//! Next best view (Wiedemann 2014, §2.2.1).
//!
//! [`ViewSpace`] takes scans in and knows of each voxel whether it is free, a surface, or hidden behind one;
//! [`next_view`] makes candidates from it, simulates a scan from each, and asks the robot for the best.
//! Candidates and gains are functions of the space alone, so that a plan can be repeated from the scans.

mod candidates;
mod carve;
mod cell;
mod ending;
mod first;
mod look;
mod measure;
mod params;
mod plan;
mod space;

pub use cell::{Counts, State};
pub use ending::{Cause, Ending};
pub use params::{Measure, Utility, ViewParams};
pub use plan::{Candidate, ChosenView, Plan, ReachedView, RefusedView, next_view};
pub use space::ViewSpace;

use crate::geometry::{Pose, Vec3};
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};

/// The pose `object_from_sensor` at `position` that looks along the unit vector `direction`, the image upright (y
/// towards the object's -z); straight up or down, the image's right is the object's x.
pub(crate) fn looking_along(position: &Vec3, direction: &Vec3) -> Pose {
    let x = (-Vec3::z()).cross(direction).try_normalize(1e-9).unwrap_or_else(Vec3::x);
    let rotation = Matrix3::from_columns(&[x, direction.cross(&x), *direction]);
    Pose::from_parts(
        Translation3::from(*position),
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation)),
    )
}

#[cfg(test)]
mod tests;

#[cfg(test)]
mod loop_tests;
