//! Conversions between ROS messages and the types of `puffer_core`: `x_message` makes a message,
//! and `x_from_message` reads one and says in words what of it does not fit.
//!
//! ```
//! use puffer_core::geometry::Scan;
//! use puffer_msgs::std_msgs::msg::Header;
//! use puffer_ros::conversions::{scan_from_message, scan_message};
//!
//! let scan = Scan { points: vec![[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]], width: 0, origins: vec![] };
//! let cloud = scan_message(&scan, Header::default());
//! assert_eq!((cloud.width, cloud.height, cloud.point_step), (2, 1, 12));
//! assert_eq!(scan_from_message(&cloud)?.points, scan.points);
//! # Ok::<(), String>(())
//! ```

mod filtered_cloud;
mod model_mesh;
mod point_fields;
mod pose;
mod raw_scan;
mod region;
mod registered_scan;

pub use filtered_cloud::{cloud_from_message, cloud_message};
pub use model_mesh::{mesh_from_message, mesh_message};
pub use pose::{
    point_message, pose_from_message, pose_from_transform, pose_message, pose_with_covariance,
    transform_message, vector_message,
};
pub use raw_scan::{scan_from_message, scan_message};
pub use region::region_from_message;
pub use registered_scan::{covariance_from_message, status_from_message, status_message};

#[cfg(test)]
mod tests;
