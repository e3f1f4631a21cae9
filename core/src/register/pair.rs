//! The registration of one scan to another.

use super::align::{Map, Prior};
use super::judge::Verdict;
use super::params::RegisterParams;
use super::registration_scan::RegistrationScan;
use super::scan_registration::register_scan;
use super::strategy::Strategy;
use crate::geometry::{Mat6, Pose};
use crate::scan::{PoseSigma, PreparedScan};
use crate::{Error, Result};

/// A scan made ready for [`align_pair`].
pub struct PairScan {
    scan: RegistrationScan,
    map: Map,
}

impl PairScan {
    /// Makes a scan ready whose pose is known with the deviation `sigma`.
    pub fn new(scan: &PreparedScan, sigma: PoseSigma, params: &RegisterParams) -> PairScan {
        let scan = RegistrationScan::new(scan, sigma, &Strategy::new(params));
        let map = scan.own_map(&Pose::identity(), scan.map_spacing);
        PairScan { scan, map }
    }
}

/// Aligns `moving` to `fixed`, from `guess` (`fixed_from_moving`); `sigma` is the uncertainty of
/// the pose of each of the two. Returns the pose `fixed_from_moving` and the verdict on it.
pub fn align_pair(
    moving: &PairScan,
    fixed: &PairScan,
    guess: &Pose,
    sigma: PoseSigma,
    params: &RegisterParams,
) -> (Pose, Verdict) {
    let prior = Prior::relative_to_map(guess, sigma);
    register_scan(&moving.scan, &fixed.map, &prior, &Strategy::new(params))
}

/// As [`align_pair`], where the uncertainty of the guess itself is known: the covariance of `xi` in
/// `T_true = guess exp(xi)`, order x y z rx ry rz, moving sensor's frame, square metres and square
/// radians.
///
/// # Errors
/// [`Error::Input`] if the covariance has no positive inverse.
pub fn align_pair_with_covariance(
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
    Ok(register_scan(&moving.scan, &fixed.map, &prior, &Strategy::new(params)))
}
