//! The two stages (Wiedemann 2014, §2.3.1): align each scan to the map, then try those put aside again.

use super::align::{Map, Moving, Prior, Radius, align};
use super::joint::Sample;
use super::verdict::{Status, Verdict};
use super::{Method, PoseSigma, RegisterParams, Registration};
use crate::geometry::{Pose, Vec3};
use crate::{Progress, Result};

/// Aligns all scans; those that no round could place are refused and keep the robot's pose.
pub(crate) fn two_stages(
    samples: &[Sample],
    robot: &[Pose],
    sigma: PoseSigma,
    params: &RegisterParams,
    progress: &Progress,
) -> Result<Registration> {
    let mut poses = robot.to_vec();
    let mut verdicts: Vec<Option<Verdict>> = vec![None; samples.len()];
    verdicts[0] = Some(Verdict::first(&sigma.information()));
    let mut waiting: Vec<usize> = (1..samples.len()).collect();
    for round in 0..params.max_rounds {
        let mut aside = Vec::new();
        for (done, &i) in waiting.iter().enumerate() {
            let fraction = done as f64 / waiting.len() as f64;
            progress.report("register", (round as f64 + fraction) / params.max_rounds as f64)?;
            let (pose, verdict) = place(samples, i, &poses, &verdicts, robot, sigma, params);
            if verdict.status == Status::Accepted {
                poses[i] = pose;
            } else {
                aside.push(i);
            }
            verdicts[i] = Some(verdict);
        }
        let stuck = aside.len() == waiting.len();
        waiting = aside;
        if waiting.is_empty() || stuck {
            break;
        }
    }
    let first =
        |verdict: Option<Verdict>| verdict.unwrap_or_else(|| Verdict::first(&sigma.information()));
    let mut verdicts: Vec<Verdict> = verdicts.into_iter().map(first).collect();
    for verdict in verdicts.iter_mut().filter(|v| v.status == Status::Deferred) {
        verdict.status = Status::Refused;
    }
    Ok(Registration { poses, verdicts, pose_sigma: sigma, residual: f64::NAN })
}

fn place(
    samples: &[Sample],
    index: usize,
    poses: &[Pose],
    verdicts: &[Option<Verdict>],
    robot: &[Pose],
    sigma: PoseSigma,
    params: &RegisterParams,
) -> (Pose, Verdict) {
    let accepted = |j: &usize| verdicts[*j].as_ref().is_some_and(|v| v.status == Status::Accepted);
    let members: Vec<usize> = (0..samples.len()).filter(|j| *j != index).filter(accepted).collect();
    let map = map_of(samples, &members, poses);
    let sample = &samples[index];
    let noise = members.iter().map(|&j| samples[j].noise).fold(sample.noise, f64::max)
        * std::f64::consts::SQRT_2;
    // The map stands where its first scan was believed to be: its error and the scan's add up.
    let information = sigma.information() / 2.0;
    let prior = Prior { pose: robot[index], information };
    let moving = Moving { points: &sample.points, normals: &sample.normals, noise };
    let radius = radius(sample, sigma, noise, params);
    let alignment = align(&moving, &map, &prior, radius, params);
    // Within the end radius a uniform residual already has 0.58 of it: the bound must know the spacing too.
    let expected = noise.max(0.3 * radius.end);
    let verdict =
        Verdict::of(&alignment, &robot[index], &information, sample.points.len(), expected, params);
    (alignment.pose, verdict)
}

fn radius(sample: &Sample, sigma: PoseSigma, noise: f64, params: &RegisterParams) -> Radius {
    let end = (1.5 * sample.spacing).max(4.0 * noise);
    let start = if params.radius > 0.0 {
        params.radius
    } else {
        3.0 * std::f64::consts::SQRT_2 * sigma.of_point(sample.distance)
    };
    Radius { start: if params.method == Method::Thesis { start } else { start.max(end) }, end }
}

fn map_of(samples: &[Sample], members: &[usize], poses: &[Pose]) -> Map {
    let mut points: Vec<Vec3> = Vec::new();
    let mut normals = Vec::new();
    for &j in members {
        let pose = &poses[j];
        points
            .extend(samples[j].points.iter().map(|p| pose.rotation * p + pose.translation.vector));
        normals.extend(samples[j].normals.iter().map(|n| pose.rotation * n));
    }
    Map::new(points, normals)
}
