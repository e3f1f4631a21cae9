//! The pose error of the robot.

use super::noise::{Dice, NoiseFamily, Use, direction};
use crate::geometry::{Pose, Twist, exp};
use crate::scans::PoseSigma;
use rand::RngExt;

/// Stated of exact poses: far below any sensor's noise, yet not zero, so that its inverse is finite.
const EXACT: f64 = 1e-6;

/// Smallest and largest length of the translation (metres) and angle (radians); both are uniform between
/// and point in random directions of the sensor frame.
fn ranges(family: NoiseFamily) -> ([f64; 2], [f64; 2]) {
    let (millimetres, degrees) = match family {
        NoiseFamily::P1 => ([0.0, 0.0], [0.0f64, 0.0]),
        NoiseFamily::P2K => ([0.1, 0.3], [0.01, 0.03]),
        NoiseFamily::P2 | NoiseFamily::P3 => ([2.0, 5.0], [0.3, 1.0]),
    };
    (millimetres.map(|mm| mm * 1e-3), degrees.map(f64::to_radians))
}

/// `exp(xi)` in `T_true = T_reported exp(xi)`: how far off a robot of the family is.
pub(crate) fn pose_error(family: NoiseFamily, dice: Dice) -> Pose {
    if family == NoiseFamily::P1 {
        return Pose::identity();
    }
    let (translation, rotation) = ranges(family);
    let mut rng = dice.rng(Use::Robot, 0);
    let mut draw = |[low, high]: [f64; 2]| direction(&mut rng) * rng.random_range(low..=high);
    let (rho, phi) = (draw(translation), draw(rotation));
    exp(&Twist::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z))
}

/// The standard deviation per axis that goes with the family's ranges: a length uniform in a..b has the mean
/// square (a^2 + a b + b^2) / 3, of which a random direction gives each axis a third.
pub(crate) fn pose_sigma(family: NoiseFamily) -> PoseSigma {
    let sigma = |[a, b]: [f64; 2]| ((a * a + a * b + b * b) / 9.0).sqrt().max(EXACT);
    let (translation, rotation) = ranges(family);
    PoseSigma { translation: sigma(translation), rotation: sigma(rotation) }
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
                let xi = log(&pose_error(family, Dice { seed: 3, view }));
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
        assert_eq!(pose_error(NoiseFamily::P1, Dice { seed: 3, view: 1 }), Pose::identity());
        assert_eq!(pose_sigma(NoiseFamily::P1).translation, 1e-6);
    }
}
