//! The pose error of the robot.

use super::noise_family::NoiseFamily;
use super::random::{RandomSource, RandomUse, random_direction};
use crate::geometry::{Pose, Twist, Vec3, exp};
use crate::scan::PoseSigma;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Standard deviation that is stated of exact poses, metres and radians: far below any sensor's
/// noise, but not zero, so that its inverse is finite.
const EXACT_POSE_SIGMA: f64 = 1e-6;

/// Smallest and largest length of the translation (metres) and of the rotation (radians) of a pose
/// error. Both lengths are uniformly distributed, with random directions in the sensor frame.
fn error_ranges(family: NoiseFamily) -> ([f64; 2], [f64; 2]) {
    let (millimetres, degrees) = match family {
        NoiseFamily::P1 => ([0.0, 0.0], [0.0f64, 0.0]),
        NoiseFamily::P2K => ([0.1, 0.3], [0.01, 0.03]),
        NoiseFamily::P2 | NoiseFamily::P3 => ([2.0, 5.0], [0.3, 1.0]),
    };
    (millimetres.map(|mm| mm * 1e-3), degrees.map(f64::to_radians))
}

/// Draws a pose error of a robot of the family: `exp(xi)` in `T_true = T_reported exp(xi)`.
pub(crate) fn draw_pose_error(family: NoiseFamily, source: RandomSource) -> Pose {
    if family == NoiseFamily::P1 {
        return Pose::identity();
    }
    let (translation, rotation) = error_ranges(family);
    let mut rng = source.rng(RandomUse::RobotPose, 0);
    let rho = draw_vector(translation, &mut rng);
    let phi = draw_vector(rotation, &mut rng);
    exp(&Twist::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z))
}

/// The standard deviation of its poses that a robot of the family states.
pub(crate) fn pose_sigma(family: NoiseFamily) -> PoseSigma {
    let (translation, rotation) = error_ranges(family);
    PoseSigma { translation: axis_sigma(translation), rotation: axis_sigma(rotation) }
}

/// A vector of random direction whose length is uniformly distributed between `low` and `high`.
fn draw_vector([low, high]: [f64; 2], rng: &mut ChaCha8Rng) -> Vec3 {
    random_direction(rng) * rng.random_range(low..=high)
}

/// The standard deviation per axis of [`draw_vector`]: a length uniform in a..b has the mean square
/// (a^2 + a b + b^2) / 3, of which a random direction gives each axis a third.
fn axis_sigma([a, b]: [f64; 2]) -> f64 {
    ((a * a + a * b + b * b) / 9.0).sqrt().max(EXACT_POSE_SIGMA)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::log;

    #[test]
    fn errors_stay_in_their_ranges_and_have_the_stated_deviation() {
        for (family, low, high) in [
            (NoiseFamily::P2K, [0.1, 0.01], [0.3, 0.03]),
            (NoiseFamily::P2, [2.0, 0.3], [5.0, 1.0]),
            (NoiseFamily::P3, [2.0, 0.3], [5.0, 1.0]),
        ] {
            let mut squares = Twist::zeros();
            let count = 4000;
            for view in 0..count {
                let xi = log(&draw_pose_error(family, RandomSource { seed: 3, view }));
                let translation = xi.fixed_rows::<3>(0).norm() * 1e3;
                let rotation = xi.fixed_rows::<3>(3).norm().to_degrees();
                assert!((low[0]..=high[0]).contains(&translation), "{translation} mm");
                assert!((low[1]..=high[1]).contains(&rotation), "{rotation} degrees");
                squares += xi.component_mul(&xi) / count as f64;
            }
            let sigma = pose_sigma(family);
            for axis in 0..6 {
                let stated = if axis < 3 { sigma.translation } else { sigma.rotation };
                let ratio = squares[axis].sqrt() / stated;
                assert!((ratio - 1.0).abs() < 0.05, "axis {axis}: {ratio}");
            }
        }
    }

    #[test]
    fn the_exact_family_is_exact_and_states_so() {
        assert_eq!(
            draw_pose_error(NoiseFamily::P1, RandomSource { seed: 3, view: 1 }),
            Pose::identity()
        );
        assert_eq!(pose_sigma(NoiseFamily::P1).translation, 1e-6);
    }
}
