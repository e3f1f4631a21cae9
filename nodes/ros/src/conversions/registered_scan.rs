//! What a registered scan says of its registration.

use puffer_core::geometry::Mat6;
use puffer_core::register::Status;
use puffer_msgs::geometry_msgs::msg::PoseWithCovariance;
use puffer_msgs::msg::RegisteredScan;

/// The constant of `puffer_msgs/msg/RegisteredScan` for a status.
pub fn status_message(status: Status) -> u8 {
    match status {
        Status::Accepted => RegisteredScan::ACCEPTED,
        Status::Deferred => RegisteredScan::DEFERRED,
        Status::Refused => RegisteredScan::REFUSED,
    }
}

/// The status of a constant of `puffer_msgs/msg/RegisteredScan`.
///
/// # Errors
/// In words, if it is none of the constants.
pub fn status_from_message(status: u8) -> Result<Status, String> {
    match status {
        RegisteredScan::ACCEPTED => Ok(Status::Accepted),
        RegisteredScan::DEFERRED => Ok(Status::Deferred),
        RegisteredScan::REFUSED => Ok(Status::Refused),
        other => Err(format!("{other} is no status of a registered scan")),
    }
}

/// The covariance of a pose, in the order x, y, z, rotation about x, y, z.
pub fn covariance_from_message(pose: &PoseWithCovariance) -> Mat6 {
    Mat6::from_fn(|row, column| pose.covariance[6 * row + column])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conversions::pose_with_covariance;
    use puffer_core::geometry::Pose;

    #[test]
    fn each_status_has_a_constant() {
        for status in [Status::Accepted, Status::Deferred, Status::Refused] {
            assert_eq!(status_from_message(status_message(status)), Ok(status));
        }
        assert!(status_from_message(77).unwrap_err().contains("77 is no status"));
    }

    #[test]
    fn a_covariance_stands_row_by_row() {
        let covariance = Mat6::from_fn(|row, column| (10 * row + column) as f64);
        let message = pose_with_covariance(&Pose::identity(), &covariance);
        assert_eq!(message.covariance[..8], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 10.0, 11.0]);
        assert_eq!(covariance_from_message(&message), covariance);
    }
}
