//! One scan placed against the map, and judged: what is wrong is found out here, before a scan joins the model.

use super::align::{Alignment, Map, Prior, Radius, align};
use super::evidence::Evidence;
use super::layers::doubled;
use super::rivals::Rivals;
use super::sample::Sample;
use super::verdict::{Status, Verdict};
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
    let moving = sample.moving(noise);
    let radius = radius(sample, &prior.information, noise, params);
    let judge = |found: &Alignment| Verdict::of(found, prior, sample.points.len(), noise, params);
    let mut found = align(&moving, map, prior, radius, params);
    if params.method == Method::Thesis {
        return (found.pose, judge(&found));
    }
    let mut pose = found.pose;
    if let Some(evidence) = Evidence::at(sample, map, &pose, radius.end, params) {
        pose = evidence.given_back(&pose, prior);
        found.information = evidence.information;
    }
    // Asked of the pose that was found: an alignment that was drawn off by far is none.
    let verdict = judge(&found);
    if verdict.status != Status::Accepted {
        return (pose, verdict);
    }
    if let Some(share) = doubled(sample, map, &pose, radius.end) {
        return (pose, verdict.unless(Some(layered(share, radius.end))));
    }
    let rivals = Rivals { sample, map, prior, radius, params };
    let ambiguous = rivals.of(&pose, &verdict.covariance).map(|rival| {
        let apart = sample.displacement(&pose, &rival.pose) * 1e3;
        let how = if rival.better { "better" } else { "as well" };
        format!("ambiguous: a pose {apart:.1} mm away fits {how}")
    });
    (pose, verdict.unless(ambiguous))
}

fn layered(share: f64, reach: f64) -> String {
    format!(
        "{:.0} % of the points form a second layer more than {:.1} mm from the map's: another object, or not this pose",
        share * 100.0,
        reach * 1e3
    )
}

fn radius(sample: &Sample, prior: &Mat6, noise: f64, params: &RegisterParams) -> Radius {
    let end = sample.reach(noise);
    let start =
        if params.radius > 0.0 { params.radius } else { (3.0 * sample.moved_by(prior)).max(end) };
    // The thesis's radius stays as it is.
    Radius { start, end: if params.method == Method::Thesis { start } else { end.min(start) } }
}
