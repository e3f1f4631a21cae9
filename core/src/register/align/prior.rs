//! The robot's pose as prior.

use crate::geometry::{Mat6, Pose, Twist, log};
use crate::scan::PoseSigma;

/// What is known of a pose before the scan is aligned.
#[derive(Clone, Copy)]
pub(crate) struct Prior {
    /// The pose that is expected.
    pub pose: Pose,
    /// The inverse of the covariance of `xi` in `T_true = pose exp(xi)`.
    pub information: Mat6,
}

impl Prior {
    /// The prior of a pose relative to the map, where the robot's poses have the deviation `sigma`.
    /// The map is where its first scan was expected to be, so that the errors of both add up.
    pub(crate) fn relative_to_map(pose: &Pose, sigma: PoseSigma) -> Prior {
        Prior { pose: *pose, information: sigma.information() / 2.0 }
    }

    /// The twist `xi` that leads from the expected pose to `pose`.
    pub(crate) fn correction(&self, pose: &Pose) -> Twist {
        log(&(self.pose.inverse() * pose))
    }

    /// The squared Mahalanobis distance of `pose` from the expected one.
    pub(crate) fn mahalanobis_squared(&self, pose: &Pose) -> f64 {
        let correction = self.correction(pose);
        correction.dot(&(self.information * correction))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::exp;

    #[test]
    fn a_correction_of_one_sigma_relative_to_the_map_counts_half() {
        let sigma = PoseSigma { translation: 0.003, rotation: 0.01 };
        let expected = exp(&Twist::new(0.1, 0.2, -0.3, 0.5, -0.2, 0.1));
        let prior = Prior::relative_to_map(&expected, sigma);
        assert_eq!(prior.mahalanobis_squared(&expected), 0.0);
        let step = Twist::new(0.003, 0.0, 0.0, 0.0, 0.0, 0.0);
        let moved = expected * exp(&step);
        assert!((prior.correction(&moved) - step).norm() < 1e-12);
        assert!((prior.mahalanobis_squared(&moved) - 0.5).abs() < 1e-9);
    }
}
