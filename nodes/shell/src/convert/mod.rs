//! Between messages and the types of core.

mod fields;
mod mesh;
mod oriented;
mod pose;
mod region;
mod scan;
mod verdict;

pub use mesh::{mesh_from_message, mesh_message};
pub use oriented::{cloud_from_message, cloud_message};
pub use pose::{
    point_message, pose_from_message, pose_from_transform, pose_message, pose_with_covariance,
    transform_message, vector_message,
};
pub use region::region_from_message;
pub use scan::{scan_from_message, scan_message};
pub use verdict::{covariance_from_message, status_from_message, status_message};

#[cfg(test)]
mod tests;
