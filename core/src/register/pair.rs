//! One scan onto another.

use super::align::{Map, Prior};
use super::place::place;
use super::sample::Sample;
use super::{PoseSigma, PreparedScan, RegisterParams, Verdict};
use crate::geometry::{Mat6, Pose};
use crate::{Error, Result};

/// A scan made ready for [`align_pair`].
pub struct PairScan {
    sample: Sample,
    map: Map,
}

impl PairScan {
    /// Makes a scan ready whose pose is known by `sigma`.
    pub fn new(scan: &PreparedScan, sigma: PoseSigma, params: &RegisterParams) -> PairScan {
        let sample = Sample::new(scan, sigma, params);
        let here = Pose::identity();
        let map = Sample::map_of(std::iter::once((&sample, &here)), sample.target_spacing);
        PairScan { sample, map }
    }
}

/// Aligns `moving` to `fixed`, from `guess` (`fixed_from_moving`); `sigma` is the uncertainty of the pose of each of the
/// two. Returns the pose `fixed_from_moving` and the verdict on it.
pub fn align_pair(
    moving: &PairScan,
    fixed: &PairScan,
    guess: &Pose,
    sigma: PoseSigma,
    params: &RegisterParams,
) -> (Pose, Verdict) {
    place(&moving.sample, &fixed.map, &Prior::of(guess, sigma), params)
}

/// As [`align_pair`], where the uncertainty of the guess itself is known: the covariance of `xi` in
/// `T_true = guess exp(xi)`, order x y z rx ry rz, moving sensor's frame, square metres and square radians.
///
/// # Errors
/// [`Error::Input`] if the covariance has no positive inverse.
pub fn align_pair_within(
    moving: &PairScan,
    fixed: &PairScan,
    guess: &Pose,
    covariance: &Mat6,
    params: &RegisterParams,
) -> Result<(Pose, Verdict)> {
    let information = covariance.cholesky().map(|c| c.inverse()).ok_or_else(|| {
        Error::input(
            "the covariance of the guess is not positive definite: state how certain each axis is",
        )
    })?;
    let prior = Prior { pose: *guess, information };
    Ok(place(&moving.sample, &fixed.map, &prior, params))
}
