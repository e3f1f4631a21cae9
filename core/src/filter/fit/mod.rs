//! Robust local surface fits: where they are made (`seeds`), within which radius (`fitter`), and
//! how: a quadric (`quadric`) by least squares with white and shared noise (`mixed_model`).

mod fitter;
mod mixed_model;
mod quadric;
mod seeds;

pub(super) use fitter::{Fitter, MIN_RADIUS_SIGMAS};
pub(super) use quadric::Fit;
pub(super) use seeds::find_seeds;
