//! One scan onto another.

use super::align::Map;
use super::sample::Sample;
use super::stages::place;
use super::{PoseSigma, PreparedScan, RegisterParams, Verdict};
use crate::geometry::Pose;

/// A scan made ready for [`align_pair`].
pub struct PairScan {
    sample: Sample,
    map: Map,
}

impl PairScan {
    /// Makes a scan ready.
    pub fn new(scan: &PreparedScan, params: &RegisterParams) -> PairScan {
        let sample = Sample::new(scan, params);
        let mut map = Map::new(sample.target_spacing);
        sample.add_to(&mut map, &Pose::identity());
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
    place(&moving.sample, &fixed.map, guess, sigma, params)
}
