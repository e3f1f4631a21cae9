//! The two stages (Wiedemann 2014, §2.3.1): align each scan to the map, then try those put aside again.

use super::align::{Map, Moving, Prior, Radius, align};
use super::joint::Sample;
use super::verdict::{Status, Verdict};
use super::{Method, PoseSigma, RegisterParams, Registration};
use crate::geometry::Pose;
use crate::{Progress, Result};

/// Aligns all scans to the first and to those accepted before them; those that no round could place are refused
/// and keep the robot's pose.
pub(crate) fn two_stages(
    samples: &[Sample],
    robot: &[Pose],
    sigma: PoseSigma,
    params: &RegisterParams,
    progress: &Progress,
) -> Result<Registration> {
    let waiting = Verdict { status: Status::Deferred, ..Verdict::first(&sigma.information()) };
    let mut verdicts = vec![waiting; samples.len()];
    verdicts[0].status = Status::Accepted;
    let mut registration =
        Registration { poses: robot.to_vec(), verdicts, pose_sigma: sigma, residual: f64::NAN };
    place_rest(samples, robot, &mut registration, params, progress)?;
    Ok(registration)
}

/// Tries to place all scans that are not accepted; returns how many joined.
pub(crate) fn place_rest(
    samples: &[Sample],
    robot: &[Pose],
    registration: &mut Registration,
    params: &RegisterParams,
    progress: &Progress,
) -> Result<usize> {
    let (mut accepted, mut waiting): (Vec<usize>, Vec<usize>) =
        (0..samples.len()).partition(|&i| registration.verdicts[i].status == Status::Accepted);
    let before = accepted.len();
    let mut map = Map::new(samples[0].target_spacing);
    for &i in &accepted {
        samples[i].add_to(&mut map, &registration.poses[i]);
    }
    for _ in 0..params.max_rounds {
        let mut aside = Vec::new();
        for &i in &waiting {
            progress.report("register", accepted.len() as f64 / samples.len() as f64)?;
            let (pose, verdict) =
                place(&samples[i], &map, &robot[i], registration.pose_sigma, params);
            if verdict.status == Status::Accepted {
                registration.poses[i] = pose;
                samples[i].add_to(&mut map, &pose);
                accepted.push(i);
            } else {
                aside.push(i);
            }
            registration.verdicts[i] = verdict;
        }
        let stuck = aside.len() == waiting.len();
        waiting = aside;
        if waiting.is_empty() || stuck {
            break;
        }
    }
    for i in waiting {
        registration.verdicts[i].status = Status::Refused;
    }
    Ok(accepted.len() - before)
}

fn place(
    sample: &Sample,
    map: &Map,
    robot: &Pose,
    sigma: PoseSigma,
    params: &RegisterParams,
) -> (Pose, Verdict) {
    // A scan's noise and the map's.
    let noise = sample.noise * std::f64::consts::SQRT_2;
    // The map stands where its first scan was believed to be: its error and the scan's add up.
    let information = sigma.information() / 2.0;
    let prior = Prior { pose: *robot, information };
    let moving = Moving { points: &sample.points, normals: &sample.normals, noise };
    let radius = radius(sample, sigma, noise, params);
    let alignment = align(&moving, map, &prior, radius, params);
    let verdict = Verdict::of(&alignment, robot, &information, sample.points.len(), noise, params);
    (alignment.pose, verdict)
}

fn radius(sample: &Sample, sigma: PoseSigma, noise: f64, params: &RegisterParams) -> Radius {
    let end = sample.reach(noise);
    let automatic = 3.0 * std::f64::consts::SQRT_2 * sigma.of_point(sample.distance);
    let start = if params.radius > 0.0 { params.radius } else { automatic.max(end) };
    // The thesis's radius stays as it is.
    Radius { start, end: if params.method == Method::Thesis { start } else { end.min(start) } }
}
