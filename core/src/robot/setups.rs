//! The robots with their sensors that are built in.

use crate::{Error, Result};

/// Names of the set-ups.
pub const SETUP_NAMES: [&str; 2] = ["kr16_laser", "omnirob_stereo"];

/// Rest positions of the KR 16-2's six joints, degrees.
const KR16_HOME_DEG: [f64; 6] = [0.0, -130.0, 120.0, 0.0, 60.0, 0.0];
/// Rest positions of the LWR's seven joints, degrees.
const LWR_HOME_DEG: [f64; 7] = [0.0, -30.0, 0.0, 90.0, 0.0, 60.0, 0.0];
/// Rest positions behind the arm of the omniRob: the jaws half open (metres), and pan and tilt of
/// the head straight ahead (radians).
const OMNIROB_HOME_REST: [f64; 3] = [0.03, 0.0, 0.0];

/// The URDF of a set-up.
///
/// # Errors
/// [`Error::Input`] that lists the known names, if `setup` is none of [`SETUP_NAMES`].
pub fn setup_urdf(setup: &str) -> Result<&'static str> {
    match setup {
        "kr16_laser" => Ok(include_str!("../../../urdf/kr16.urdf")),
        "omnirob_stereo" => Ok(include_str!("../../../urdf/omnirob.urdf")),
        _ => Err(unknown_setup(setup)),
    }
}

/// Joint positions in which a set-up rests, in the order of its joints, radians and metres.
///
/// # Errors
/// As [`setup_urdf`].
pub fn home_configuration(setup: &str) -> Result<Vec<f64>> {
    match setup {
        "kr16_laser" => Ok(KR16_HOME_DEG.map(f64::to_radians).to_vec()),
        "omnirob_stereo" => {
            Ok(LWR_HOME_DEG.map(f64::to_radians).into_iter().chain(OMNIROB_HOME_REST).collect())
        }
        _ => Err(unknown_setup(setup)),
    }
}

fn unknown_setup(setup: &str) -> Error {
    Error::input(format!("there is no set-up `{setup}`; there are {}", SETUP_NAMES.join(", ")))
}
