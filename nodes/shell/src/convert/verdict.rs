//! Verdicts on scans.

use puffer_core::geometry::Mat6;
use puffer_core::register::Status;
use puffer_msgs::geometry_msgs::msg::PoseWithCovariance;
use puffer_msgs::msg::RegisteredScan;

/// The constant of a status.
pub fn status_message(status: Status) -> u8 {
    match status {
        Status::Accepted => RegisteredScan::ACCEPTED,
        Status::Deferred => RegisteredScan::DEFERRED,
        Status::Refused => RegisteredScan::REFUSED,
    }
}

/// The status of a constant.
///
/// # Errors
/// The number, if it is none of them.
pub fn status_from_message(status: u8) -> Result<Status, String> {
    match status {
        RegisteredScan::ACCEPTED => Ok(Status::Accepted),
        RegisteredScan::DEFERRED => Ok(Status::Deferred),
        RegisteredScan::REFUSED => Ok(Status::Refused),
        other => Err(format!("{other} is no status of a registered scan")),
    }
}

/// The covariance of a pose.
pub fn covariance_from_message(pose: &PoseWithCovariance) -> Mat6 {
    Mat6::from_fn(|row, column| pose.covariance[6 * row + column])
}
