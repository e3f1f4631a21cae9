//! One scan placed against the map, and judged.

use super::align::{Map, Moving, Prior, Radius, align};
use super::sample::Sample;
use super::verdict::Verdict;
use super::{Method, PoseSigma, RegisterParams};
use crate::geometry::{Mat6, Pose};

impl Prior {
    /// Of a scan whose pose has the deviation `sigma`, as has the map: it stands where its first scan was believed to
    /// be, so that its error and the scan's add up.
    pub(crate) fn of(pose: &Pose, sigma: PoseSigma) -> Prior {
        Prior { pose: *pose, information: sigma.information() / 2.0 }
    }
}

/// Aligns one scan to the map and judges the outcome; `prior` is the pose believed relative to the map.
pub(crate) fn place(
    sample: &Sample,
    map: &Map,
    prior: &Prior,
    params: &RegisterParams,
) -> (Pose, Verdict) {
    // A scan's noise and the map's.
    let noise = sample.noise * std::f64::consts::SQRT_2;
    let moving =
        Moving { points: &sample.points, normals: &sample.normals, rays: &sample.rays, noise };
    let radius = radius(sample, &prior.information, noise, params);
    let found = align(&moving, map, prior, radius, params);
    let verdict = Verdict::of(&found, prior, sample.points.len(), noise, params);
    (found.pose, verdict)
}

fn radius(sample: &Sample, prior: &Mat6, noise: f64, params: &RegisterParams) -> Radius {
    let end = sample.reach(noise);
    let start =
        if params.radius > 0.0 { params.radius } else { (3.0 * sample.moved_by(prior)).max(end) };
    // The thesis's radius stays as it is.
    Radius { start, end: if params.method == Method::Thesis { start } else { end.min(start) } }
}
