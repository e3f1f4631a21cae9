//! The two stages (Wiedemann 2014, §2.3.1): align each scan to the map, then try those put aside again.

use super::align::{Map, Prior, correspondences};
use super::joint::{Start, optimise};
use super::place::place;
use super::sample::Sample;
use super::verdict::{Status, Verdict};
use super::{Method, PoseSigma, RegisterParams, Registration};
use crate::geometry::Pose;
use crate::{Progress, Result};
use rayon::prelude::*;

/// Points that tell how much of a scan overlaps: every so many.
const OVERLAP_STRIDE: usize = 8;

impl Sample {
    /// How far a point may lie from where the robot's pose puts it, relative to the map's own error.
    fn pose_reach(&self, sigma: PoseSigma) -> f64 {
        3.0 * std::f64::consts::SQRT_2 * sigma.of_point(self.distance)
    }

    /// Sampled points near the map, normals alike, if the robot's pose is right.
    fn overlap(&self, map: &Map, robot: &Pose, sigma: PoseSigma, params: &RegisterParams) -> usize {
        let reach = self.pose_reach(sigma).max(self.target_spacing);
        let thin = self.every(OVERLAP_STRIDE);
        correspondences(&thin.moving(self.noise), map, robot, reach, params).len()
    }
}

/// The verdict on a scan before it was looked at.
pub(crate) fn waiting(sigma: PoseSigma) -> Verdict {
    Verdict { status: Status::Deferred, ..Verdict::first(&sigma.information()) }
}

/// Aligns all scans to the first (where few can join it, to the one that most others overlap with) and to those accepted
/// before them; those that no round could place are refused and keep the robot's pose.
pub(crate) fn two_stages(
    samples: &[Sample],
    robot: &[Pose],
    sigma: PoseSigma,
    params: &RegisterParams,
    progress: &Progress,
) -> Result<Registration> {
    let from = |start: usize| -> Result<(usize, Registration)> {
        let mut verdicts = vec![waiting(sigma); samples.len()];
        verdicts[start].status = Status::Accepted;
        let mut registration =
            Registration { poses: robot.to_vec(), verdicts, pose_sigma: sigma, residual: f64::NAN };
        let joined = place_rest(samples, robot, &mut registration, params, progress)?;
        Ok((joined, registration))
    };
    let (joined, registration) = from(0)?;
    if params.method == Method::Thesis || 2 * (joined + 1) >= samples.len() {
        return Ok(registration);
    }
    // The first scan shares too little with the others for them to join it.
    let (more, other) = from(most_central(samples, robot, sigma, params))?;
    Ok(if more > joined { other } else { registration })
}

/// The scan that the others overlap with most, if the robot's poses are right.
fn most_central(
    samples: &[Sample],
    robot: &[Pose],
    sigma: PoseSigma,
    params: &RegisterParams,
) -> usize {
    let shared = |center: usize| -> usize {
        let alone = std::iter::once((&samples[center], &robot[center]));
        let map = Sample::map_of(alone, samples[0].target_spacing);
        let others = (0..samples.len()).filter(|&i| i != center);
        others.map(|i| samples[i].overlap(&map, &robot[i], sigma, params)).sum()
    };
    let order = (0..samples.len()).into_par_iter().map(|i| (shared(i), std::cmp::Reverse(i)));
    order.max().map_or(0, |(_, std::cmp::Reverse(i))| i)
}

/// Tries to place scans that fit each of the others alone, but not all of them: two scans that
/// share a face are put together in the directions that it holds, and stay where the robot says in
/// the others. A third that shares faces with both ties them in these directions too, but as they
/// stand it fits one of them only. So all are moved together first; each must then lie on the
/// surface of those accepted before. Returns how many joined.
pub(crate) fn tie(
    samples: &[Sample],
    robot: &[Pose],
    registration: &mut Registration,
    params: &RegisterParams,
    progress: &Progress,
) -> Result<usize> {
    let near = |verdict: &Verdict| {
        verdict.status != Status::Accepted
            && verdict.overlap >= params.min_overlap
            && verdict.correspondences >= params.min_correspondences
    };
    let waiting: Vec<usize> =
        (0..samples.len()).filter(|&i| near(&registration.verdicts[i])).collect();
    if waiting.is_empty() {
        return Ok(0);
    }
    let mut tied = registration.clone();
    waiting.iter().for_each(|&i| tied.verdicts[i].status = Status::Accepted);
    optimise(samples, robot, &mut tied, Start::Coarse, params, progress)?;
    for &i in &waiting {
        tied.verdicts[i].status = Status::Refused;
        tied.poses[i] = robot[i];
    }
    let joined = place_rest(samples, robot, &mut tied, params, progress)?;
    if joined == 0 {
        return Ok(0);
    }
    if joined < waiting.len() {
        // The others' pull goes with them.
        optimise(samples, robot, &mut tied, Start::Coarse, params, progress)?;
    }
    *registration = tied;
    Ok(joined)
}

/// Tries to place all scans that are not accepted, each time the one that overlaps most with the map; one that fails
/// is put aside until the map has grown, at most `max_rounds` times. Returns how many joined.
pub(crate) fn place_rest(
    samples: &[Sample],
    robot: &[Pose],
    registration: &mut Registration,
    params: &RegisterParams,
    progress: &Progress,
) -> Result<usize> {
    let (accepted, mut waiting): (Vec<usize>, Vec<usize>) =
        (0..samples.len()).partition(|&i| registration.verdicts[i].status == Status::Accepted);
    let sigma = registration.pose_sigma;
    let placed = accepted.iter().map(|&i| (&samples[i], &registration.poses[i]));
    let mut map = Sample::map_of(placed, samples[0].target_spacing);
    let mut tries = vec![0; samples.len()];
    let mut joined = 0;
    loop {
        let mut order: Vec<(usize, usize)> = waiting
            .iter()
            .filter(|&&i| tries[i] < params.max_rounds)
            .map(|&i| (samples[i].overlap(&map, &robot[i], sigma, params), i))
            .collect();
        order.sort_by_key(|&(overlap, i)| (std::cmp::Reverse(overlap), i));
        let mut found = None;
        for (_, i) in order {
            progress.report("register", (accepted.len() + joined) as f64 / samples.len() as f64)?;
            tries[i] += 1;
            let prior = Prior::of(&robot[i], sigma);
            let (pose, verdict) = place(&samples[i], &map, &prior, params);
            let good = verdict.status == Status::Accepted;
            registration.verdicts[i] = verdict;
            if good {
                registration.poses[i] = pose;
                found = Some(i);
                break;
            }
        }
        let Some(i) = found else { break };
        samples[i].add_to(&mut map, &registration.poses[i]);
        waiting.retain(|&j| j != i);
        joined += 1;
    }
    for i in waiting {
        registration.verdicts[i].status = Status::Refused;
    }
    Ok(joined)
}
