//! Joint optimisation of all accepted scans: point-to-plane residuals between every two that overlap, and the
//! robot's pose of each as prior (multi-view registration; Pulli 1999 for the problem, Barfoot 2017 for the
//! perturbations). Without a fixed scan, so that the error is spread and the priors alone place the whole.

use super::align::{Map, halfway};
use super::factors::{scan_to_scan, tukey};
use super::verdict::Status;
use super::{PreparedScan, RegisterParams, Registration};
use crate::geometry::{Aabb, KdTree, Pose, Vec3, exp, log, median};
use crate::{Error, Progress, Result};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// One scan made ready for registration, sensor frame.
pub(crate) struct Sample {
    /// The points that are aligned.
    pub points: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    /// Denser points, for others to be aligned to.
    targets: Vec<Vec3>,
    target_normals: Vec<Vec3>,
    /// Distance between the targets, metres.
    pub target_spacing: f64,
    pub noise: f64,
    /// Median distance of the points from the sensor, metres.
    pub distance: f64,
    /// Diagonal of the points' box, metres.
    pub extent: f64,
    tree: KdTree,
    bounds: Aabb,
}

/// A point of one scan and the plane of another that it should lie on.
#[derive(Clone, Copy)]
pub(crate) struct Match {
    /// Index of the point.
    pub point: usize,
    /// A point of the plane, and its normal, in the other scan's frame.
    pub target: Vec3,
    pub plane: Vec3,
    /// Signed distance to the plane, metres.
    pub distance: f64,
}

impl Sample {
    pub(crate) fn new(scan: &PreparedScan, count: usize) -> Sample {
        let kept = scan.sample(count);
        let points: Vec<Vec3> = kept.iter().map(|&i| scan.points[i]).collect();
        let dense = scan.sample(TARGETS);
        let targets: Vec<Vec3> = dense.iter().map(|&i| scan.points[i]).collect();
        let bounds = Aabb::of(&targets);
        Sample {
            normals: kept.iter().map(|&i| scan.normals[i]).collect(),
            noise: scan.noise.max(1e-6),
            target_spacing: scan.spacing
                * (scan.points.len() as f64 / targets.len().max(1) as f64).sqrt(),
            distance: median(points.iter().map(Vec3::norm).collect()).unwrap_or(0.0),
            extent: bounds.diagonal(),
            tree: KdTree::new(&targets),
            target_normals: dense.iter().map(|&i| scan.normals[i]).collect(),
            targets,
            bounds,
            points,
        }
    }

    /// Adds the targets, seen from `pose`, to the map.
    pub(crate) fn add_to(&self, map: &mut Map, pose: &Pose) {
        map.insert(&self.targets, &self.target_normals, pose);
    }

    /// Radius within which an aligned point finds its surface, with residuals of deviation `noise` (metres).
    pub(crate) fn reach(&self, noise: f64) -> f64 {
        (3.0 * self.target_spacing).max(4.0 * noise)
    }

    /// For each point that has one, its closest point in `other` within `reach`, normals within `cosine`.
    pub(crate) fn matches<'a>(
        &'a self,
        other: &'a Sample,
        other_from_self: &'a Pose,
        reach: f64,
        cosine: f64,
    ) -> impl Iterator<Item = Match> + 'a {
        let bounds = other.bounds.padded(reach);
        self.points.iter().zip(&self.normals).enumerate().filter_map(move |(point, (p, normal))| {
            let seen = other_from_self.rotation * p + other_from_self.translation.vector;
            if !bounds.contains(&seen) {
                return None;
            }
            let (target, _) = other.tree.nearest_within(&seen, reach)?;
            let (there, here) = (&other.target_normals[target], other_from_self.rotation * normal);
            let agreement = there.dot(&here);
            let plane = halfway(there, &here, agreement);
            let target = other.targets[target];
            let distance = plane.dot(&(seen - target));
            (agreement >= cosine).then_some(Match { point, target, plane, distance })
        })
    }
}

/// Targets kept of a scan: at a tenth of a million, searches take longer and find nothing better.
const TARGETS: usize = 40_000;
/// The radius shrinks to its end by this factor a pass.
const SHRINK: f64 = 0.6;
/// Gauss-Newton steps with the same correspondences.
const STEPS: usize = 2;

/// Moves the poses of all accepted scans to their joint optimum.
pub(crate) fn optimise(
    samples: &[Sample],
    robot: &[Pose],
    registration: &mut Registration,
    params: &RegisterParams,
    progress: &Progress,
) -> Result<()> {
    let members: Vec<usize> = (0..samples.len())
        .filter(|&i| registration.verdicts[i].status == Status::Accepted)
        .collect();
    if members.len() < 2 {
        return Ok(());
    }
    let mut poses: Vec<Pose> = members.iter().map(|&i| registration.poses[i]).collect();
    let information = registration.pose_sigma.information();
    let noise =
        members.iter().map(|&i| samples[i].noise).fold(0.0, f64::max) * std::f64::consts::SQRT_2;
    let end = members.iter().map(|&i| samples[i].reach(noise)).fold(0.0, f64::max);
    let mut reach = (4.0 * end)
        .min(end.max(3.0 * registration.pose_sigma.of_point(samples[members[0]].distance)));
    let mut hessian = DMatrix::zeros(0, 0);
    for pass in 0..params.joint_iterations {
        progress.report("optimise", pass as f64 / params.joint_iterations as f64)?;
        let cosine = params.max_normal_angle.cos();
        let pairs = pairs(samples, &members, &poses, reach, cosine);
        let scale = robust_scale(&pairs, noise / 2.0);
        let mut moved = 0.0_f64;
        for _ in 0..STEPS {
            let mut gradient;
            (hessian, gradient) =
                system(samples, &members, &poses, &pairs, scale, params.information_share);
            for (k, pose) in poses.iter().enumerate() {
                let correction = information * log(&(robot[members[k]].inverse() * pose));
                let mut block = hessian.fixed_view_mut::<6, 6>(6 * k, 6 * k);
                block += information;
                let mut rows = gradient.fixed_rows_mut::<6>(6 * k);
                rows += correction;
            }
            let Some(solver) = hessian.clone().cholesky() else {
                return Err(Error::input(
                    "the joint registration is singular: is a pose sigma infinite?",
                ));
            };
            let step = solver.solve(&-gradient);
            for (k, pose) in poses.iter_mut().enumerate() {
                *pose *= exp(&step.fixed_rows::<6>(6 * k).into_owned());
            }
            moved = moved.max(step.amax());
        }
        let at_end = reach <= end;
        reach = (reach * SHRINK).max(end);
        if at_end && moved < 2e-6 {
            break;
        }
    }
    let covariance = hessian.cholesky().map(|c| c.inverse());
    for (k, &i) in members.iter().enumerate() {
        registration.poses[i] = poses[k];
        if let Some(covariance) = &covariance {
            registration.verdicts[i].covariance =
                covariance.fixed_view::<6, 6>(6 * k, 6 * k).into_owned();
        }
    }
    Ok(())
}

/// Correspondences from scan `from` to scan `to` (positions in the list of members).
struct Pair {
    from: usize,
    to: usize,
    matches: Vec<Match>,
}

fn pairs(
    samples: &[Sample],
    members: &[usize],
    poses: &[Pose],
    reach: f64,
    cosine: f64,
) -> Vec<Pair> {
    let indices: Vec<(usize, usize)> = (0..members.len())
        .flat_map(|from| (0..members.len()).filter(move |&to| to != from).map(move |to| (from, to)))
        .collect();
    indices
        .into_par_iter()
        .map(|(from, to)| {
            let to_from = poses[to].inverse() * poses[from];
            let (a, b) = (&samples[members[from]], &samples[members[to]]);
            Pair { from, to, matches: a.matches(b, &to_from, reach, cosine).collect() }
        })
        .filter(|pair| pair.matches.len() >= 20)
        .collect()
}

/// Standard deviation of the residuals by their median absolute deviation, not below `least`.
fn robust_scale(pairs: &[Pair], least: f64) -> f64 {
    let residuals = pairs.iter().flat_map(|p| p.matches.iter().map(|m| m.distance.abs())).collect();
    median(residuals).map_or(least, |m| (1.4826 * m).max(least))
}

fn system(
    samples: &[Sample],
    members: &[usize],
    poses: &[Pose],
    pairs: &[Pair],
    scale: f64,
    share: f64,
) -> (DMatrix<f64>, DVector<f64>) {
    let blocks: Vec<_> = pairs
        .par_iter()
        .map(|pair| {
            let a = &samples[members[pair.from]];
            let mut sums = nalgebra::SMatrix::<f64, 12, 13>::zeros();
            for m in &pair.matches {
                let (r, by_from, by_to) = scan_to_scan(
                    &poses[pair.from],
                    &poses[pair.to],
                    &a.points[m.point],
                    &m.target,
                    &m.plane,
                );
                let weight = tukey(r / scale) * share / (scale * scale);
                let mut row = nalgebra::SVector::<f64, 13>::zeros();
                row.fixed_rows_mut::<6>(0).copy_from(&by_from);
                row.fixed_rows_mut::<6>(6).copy_from(&by_to);
                row[12] = r;
                sums += row.fixed_rows::<12>(0) * row.transpose() * weight;
            }
            sums
        })
        .collect();
    let size = 6 * members.len();
    let (mut hessian, mut gradient) = (DMatrix::zeros(size, size), DVector::zeros(size));
    for (pair, sums) in pairs.iter().zip(&blocks) {
        let places = [6 * pair.from, 6 * pair.to];
        for (r, &row) in places.iter().enumerate() {
            let mut rows = gradient.fixed_rows_mut::<6>(row);
            rows += sums.fixed_view::<6, 1>(6 * r, 12);
            for (c, &column) in places.iter().enumerate() {
                let mut block = hessian.fixed_view_mut::<6, 6>(row, column);
                block += sums.fixed_view::<6, 6>(6 * r, 6 * c);
            }
        }
    }
    (hessian, gradient)
}

/// Root mean square point-to-plane distance between the accepted scans, metres, robustly (from the median
/// absolute distance); NaN if no two overlap.
pub(crate) fn residual(samples: &[Sample], registration: &Registration) -> f64 {
    let members: Vec<usize> = (0..samples.len())
        .filter(|&i| registration.verdicts[i].status == Status::Accepted)
        .collect();
    let poses: Vec<Pose> = members.iter().map(|&i| registration.poses[i]).collect();
    let reach = samples.iter().map(|s| s.reach(1.5 * s.noise)).fold(0.0, f64::max);
    let pairs = pairs(samples, &members, &poses, reach, 0.7);
    if pairs.is_empty() { f64::NAN } else { robust_scale(&pairs, 0.0) }
}
