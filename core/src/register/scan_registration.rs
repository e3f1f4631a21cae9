//! The registration of one scan to the map: what is wrong with an alignment is found out here,
//! before the scan joins the model.

use super::align::{Map, Prior, SearchRadius, align};
use super::judge::{AmbiguityCheck, Observability, Verdict, second_layer_ratio};
use super::registration_scan::RegistrationScan;
use super::strategy::Strategy;
use crate::geometry::{Mat6, Pose};
use std::f64::consts::SQRT_2;

/// The search radius begins at this many standard deviations of a point whose pose is the prior's.
const SEARCH_SIGMAS: f64 = 3.0;

/// Aligns one scan to the map and judges the outcome; `prior` is its expected pose relative to the
/// map. Returns the pose `object_from_sensor` and the verdict.
pub(crate) fn register_scan(
    scan: &RegistrationScan,
    map: &Map,
    prior: &Prior,
    strategy: &Strategy,
) -> (Pose, Verdict) {
    // The noise of the scan and that of the map add up.
    let noise = scan.noise * SQRT_2;
    let radius = search_radius(scan, &prior.information, noise, strategy);
    let mut alignment = align(&scan.source(noise), map, prior, radius, strategy);
    let sampled = scan.points.len();
    if !strategy.examines_alignments {
        let verdict = Verdict::from_alignment(&alignment, prior, sampled, noise, strategy);
        return (alignment.pose, verdict);
    }
    let mut pose = alignment.pose;
    if let Some(observability) =
        Observability::evaluate(scan, map, &pose, radius.end, &strategy.params)
    {
        pose = observability.remap_to_prior(&pose, prior);
        alignment.information = observability.information;
    }
    // The pose that was found is judged, not the remapped one: an alignment that was drawn away by
    // far is wrong even if most of its correction is undone.
    let verdict = Verdict::from_alignment(&alignment, prior, sampled, noise, strategy);
    if !verdict.is_accepted() {
        return (pose, verdict);
    }
    if let Some(share) = second_layer_ratio(scan, map, &pose, radius.end) {
        return (pose, verdict.unless(Some(second_layer_reason(share, radius.end))));
    }
    let check = AmbiguityCheck { scan, map, prior, radius, strategy };
    let ambiguity = check.find_rival(&pose, &verdict.covariance).map(|rival| {
        let apart = scan.displacement(&pose, &rival.pose) * 1e3;
        let how = if rival.better { "better" } else { "as well" };
        format!("ambiguous: a pose {apart:.1} mm away fits {how}")
    });
    (pose, verdict.unless(ambiguity))
}

fn second_layer_reason(share: f64, reach: f64) -> String {
    format!(
        "{:.0} % of the points form a second layer more than {:.1} mm from the map's: another object, or not this pose",
        share * 100.0,
        reach * 1e3
    )
}

fn search_radius(
    scan: &RegistrationScan,
    prior_information: &Mat6,
    noise: f64,
    strategy: &Strategy,
) -> SearchRadius {
    let end = scan.reach(noise);
    let start = if strategy.params.radius > 0.0 {
        strategy.params.radius
    } else {
        (SEARCH_SIGMAS * scan.moved_by(prior_information)).max(end)
    };
    SearchRadius { start, end: if strategy.shrinks_radius { end.min(start) } else { start } }
}
