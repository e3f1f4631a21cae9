//! The descriptions of the set-ups, built in.

use crate::{Error, Result};

/// Names of the set-ups.
pub const SETUPS: [&str; 2] = ["kr16_laser", "omnirob_stereo"];

/// The URDF of a set-up.
///
/// # Errors
/// [`Error::Input`] with the names that there are, if `setup` is none of [`SETUPS`].
pub fn description(setup: &str) -> Result<&'static str> {
    match setup {
        "kr16_laser" => Ok(include_str!("../../../urdf/kr16.urdf")),
        "omnirob_stereo" => Ok(include_str!("../../../urdf/omnirob.urdf")),
        _ => Err(unknown(setup)),
    }
}

/// Joint positions in which a set-up rests, in the order of its joints, radians and metres.
///
/// # Errors
/// As [`description`].
pub fn home(setup: &str) -> Result<Vec<f64>> {
    let degrees: &[f64] = match setup {
        "kr16_laser" => &[0.0, -130.0, 120.0, 0.0, 60.0, 0.0],
        "omnirob_stereo" => {
            let arm = [0.0, -30.0, 0.0, 90.0, 0.0, 60.0, 0.0];
            // Jaws half open; the head looks ahead.
            return Ok(arm.iter().map(|d: &f64| d.to_radians()).chain([0.03, 0.0, 0.0]).collect());
        }
        _ => return Err(unknown(setup)),
    };
    Ok(degrees.iter().map(|d| d.to_radians()).collect())
}

fn unknown(setup: &str) -> Error {
    Error::input(format!("there is no set-up `{setup}`; there are {}", SETUPS.join(", ")))
}
