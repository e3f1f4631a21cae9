//! What two scans truly say of their relative pose, beyond what their noise pretends.
//!
//! The information of point-to-plane residuals is a sum of J J^T, where J depends on the normal. Noise of the
//! normals, d, adds E[d d^T] to it in every direction, also in those which the surface leaves open: a cylinder seems
//! to know its spin. The two scans measured the normals independently, so that
//!
//! ```text
//! H = s / sigma^2 sum_i w_i (J_i K_i^T + K_i J_i^T) / 2                                         (1)
//! ```
//!
//! with J from the moving scan's normals and K from the map's has the expectation which noise-free normals
//! give. Here sigma is the residuals' own spread and s the share that neighbours' common noise leaves
//! (`correlation`). Directions are compared by how far they move the points: with M the mean of the squared
//! displacements, H v = lambda M v. A direction in which (1) does not stand out of its own standard error is open;
//! along it the prior alone decides (solution remapping; Zhang, Kaess & Singh 2016, On Degeneracy of
//! Optimization-based State Estimation Problems).

use super::RegisterParams;
use super::align::{Map, Prior};
use super::correlation::{Correlation, Residuals};
use super::factors::{point_motion, point_to_plane, tukey};
use super::sample::Sample;
use crate::geometry::{Mat6, Pose, Twist, Vec3, exp, log, median};
use nalgebra::{DMatrix, SymmetricEigen};
use rayon::prelude::*;

/// Standard errors by which the information on a direction must stand out of zero.
const SIGNIFICANT: f64 = 2.0;
/// Independent measurements that a scan counts for at most. Noise that changes slowly over a scan (the drift of a sweep,
/// a matcher's bias on slopes) moves it as a whole: the alignment takes that up, so that residuals do not show it.
const MOST_INDEPENDENT: f64 = 12.0;

/// Points of a scan that are asked: neighbours repeat one another.
const POINTS: usize = 1000;

/// A point of the scan on the map.
struct Match {
    /// Moving frame.
    point: Vec3,
    residual: f64,
    /// Derivatives of the residual by the pose, with the normal of the scan and that of the map.
    own: Twist,
    other: Twist,
}

/// What the geometry says at a pose.
pub(crate) struct Evidence {
    /// Information beyond the normals' noise, only in directions that are not open.
    pub information: Mat6,
    /// Motions that the surface leaves open; each moves the points by one metre in the mean square.
    open: Vec<Twist>,
}

impl Evidence {
    /// Of the points of `sample` within `reach` (metres) of the map at `pose`; `None` if they are too few to tell.
    pub(crate) fn at(
        sample: &Sample,
        map: &Map,
        pose: &Pose,
        reach: f64,
        params: &RegisterParams,
    ) -> Option<Evidence> {
        let found = matches(sample, map, pose, reach, params.max_normal_angle.cos());
        let off = median(found.iter().map(|m| m.residual.abs()).collect())?;
        // The median absolute deviation of a normal distribution is 0.6745 standard deviations.
        let spread = (off / 0.6745).max(0.3 * sample.noise);
        // What is on the surface is asked with the noise that is stated, how well it lies there with its own.
        let width = spread.max(std::f64::consts::SQRT_2 * sample.noise);
        let kept: Vec<(&Match, f64)> = found
            .iter()
            .map(|m| (m, tukey(m.residual / width)))
            .filter(|(_, weight)| *weight > 0.0)
            .collect();
        let count = kept.len() as f64;
        let between = sample.extent / count.sqrt();
        let share = independent(&kept, |m| m.residual, between).min(MOST_INDEPENDENT / count);
        let directions = Directions::of(&kept)?;
        let mut evidence = Evidence { information: Mat6::zeros(), open: Vec::new() };
        for v in &directions.vectors {
            match known(v, &kept, between) {
                Some(lambda) => {
                    let covector = directions.metric * v;
                    let scale = lambda * share / (spread * spread);
                    evidence.information += covector * covector.transpose() * scale;
                }
                None => evidence.open.push(*v),
            }
        }
        Some(evidence)
    }

    /// `pose`, moved along the open directions to where the prior puts it.
    pub(crate) fn given_back(&self, pose: &Pose, prior: &Prior) -> Pose {
        if self.open.is_empty() {
            return *pose;
        }
        let open = DMatrix::from_fn(6, self.open.len(), |r, c| self.open[c][r]);
        let off = log(&(prior.pose.inverse() * pose));
        let within = open.transpose() * prior.information * &open;
        let Some(solver) = within.cholesky() else { return *pose };
        let step = -&open * solver.solve(&(open.transpose() * (prior.information * off)));
        pose * exp(&step.fixed_rows::<6>(0).into_owned())
    }
}

fn matches(sample: &Sample, map: &Map, pose: &Pose, reach: f64, cosine: f64) -> Vec<Match> {
    let find = |p: &Vec3, normal: &Vec3| {
        let moved = pose.rotation * p + pose.translation.vector;
        let target = map.nearest_within(&moved, reach)?;
        let here = pose.rotation * normal;
        if target.normal.dot(&here) < cosine {
            return None;
        }
        let derivative = |n: &Vec3| point_to_plane(pose, p, &target.point, n);
        let ((a, own), (b, other)) = (derivative(&here), derivative(&target.normal));
        Some(Match { point: *p, residual: (a + b) / 2.0, own, other })
    };
    let stride = sample.points.len().div_ceil(POINTS).max(1);
    (0..sample.points.len())
        .into_par_iter()
        .step_by(stride)
        .filter_map(|i| find(&sample.points[i], &sample.normals[i]))
        .collect()
}

/// Directions of motion that do not mix in (1), each of which moves the points by one metre in the mean square.
struct Directions {
    /// M, a sum over the points.
    metric: Mat6,
    vectors: Vec<Twist>,
}

impl Directions {
    fn of(kept: &[(&Match, f64)]) -> Option<Directions> {
        let (mut metric, mut cross) = (Mat6::zeros(), Mat6::zeros());
        for (m, weight) in kept {
            let moves = point_motion(&m.point);
            metric += moves.transpose() * moves * *weight;
            let product = m.own * m.other.transpose() * (0.5 * weight);
            cross += product + product.transpose();
        }
        let inverse = metric.cholesky()?.l().try_inverse()?;
        let eigen = SymmetricEigen::new(inverse * cross * inverse.transpose());
        let vectors = eigen.eigenvectors.column_iter().map(|u| inverse.transpose() * u).collect();
        Some(Directions { metric, vectors })
    }
}

/// The eigenvalue of (1), without its scale, of a direction that stands out of what the normals' noise, which is half of
/// what they differ by, would give; `width` (metres) is the distance between the matches.
fn known(v: &Twist, kept: &[(&Match, f64)], width: f64) -> Option<f64> {
    let (mut sum, mut noise) = (0.0, 0.0);
    for (m, weight) in kept {
        let (a, b) = (m.own.dot(v), m.other.dot(v));
        sum += weight * a * b;
        noise += weight * (a - b) * (a - b) / 2.0;
    }
    // If one independent measurement alone would make it stand out, how many there are need not be known.
    let stands_out = sum > SIGNIFICANT * noise || {
        let share = independent(kept, |m| m.own.dot(v) - m.other.dot(v), width);
        sum > SIGNIFICANT * noise / (kept.len() as f64 * share).max(1.0).sqrt()
    };
    stands_out.then_some(sum)
}

/// The share of independent values among those of the matches, which lie about `width` (metres) apart.
fn independent(kept: &[(&Match, f64)], of: impl Fn(&Match) -> f64, width: f64) -> f64 {
    let at = kept.iter().map(|(m, _)| m.point).collect();
    let value = kept.iter().map(|(m, _)| of(m)).collect();
    Correlation::learn(&[Residuals { at, value }], width).independent_share(width)
}
