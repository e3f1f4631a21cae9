//! The uncertainty of a pose that the robot reports.

use crate::geometry::Mat6;

/// Standard deviations per axis of `xi` in `T_true = T exp(xi)` (right perturbation, sensor frame).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseSigma {
    /// Metres.
    pub translation: f64,
    /// Radians.
    pub rotation: f64,
}

/// Smallest deviation of a position, metres: no robot is better, and the information stays finite
/// for poses that are called exact.
const MIN_TRANSLATION_SIGMA_M: f64 = 1e-6;
/// The same for the orientation, radians.
const MIN_ROTATION_SIGMA_RAD: f64 = 1e-6;

impl PoseSigma {
    /// The inverse of the covariance.
    pub(crate) fn information(&self) -> Mat6 {
        let translation = self.translation.max(MIN_TRANSLATION_SIGMA_M).powi(-2);
        let rotation = self.rotation.max(MIN_ROTATION_SIGMA_RAD).powi(-2);
        Mat6::from_diagonal(&nalgebra::Vector6::new(
            translation,
            translation,
            translation,
            rotation,
            rotation,
            rotation,
        ))
    }

    /// Standard deviation of a point at `distance` (metres) from the sensor.
    pub(crate) fn point_sigma(&self, distance: f64) -> f64 {
        self.translation.hypot(self.rotation * distance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn information_is_the_inverse_covariance_and_finite_for_exact_poses() {
        let sigma = PoseSigma { translation: 0.002, rotation: 0.01 };
        let information = sigma.information();
        assert!((information[(0, 0)] - 250_000.0).abs() < 1e-6);
        assert!((information[(5, 5)] - 10_000.0).abs() < 1e-8);
        let exact = PoseSigma { translation: 0.0, rotation: 0.0 };
        assert!(exact.information().iter().all(|v| v.is_finite()));
    }

    #[test]
    fn a_far_point_is_less_certain() {
        let sigma = PoseSigma { translation: 0.003, rotation: 0.01 };
        assert_eq!(sigma.point_sigma(0.0), 0.003);
        assert!((sigma.point_sigma(0.4) - 0.005).abs() < 1e-15);
    }
}
