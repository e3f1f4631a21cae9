//! One scan onto the map: iterative closest points in the stages of Rusinkiewicz & Levoy 2001 (Efficient Variants of
//! the ICP Algorithm), each a file with its variants, and the robot's pose as prior.
//!
//! | stage | file |
//! |---|---|
//! | 1 selection of points | `selection` |
//! | 2 matching them with the map's | `matching`, which searches `map` |
//! | 3 weighting the pairs | `weighting`, which also holds the robust kernels |
//! | 4 rejecting pairs | `rejection`, with `boundary` |
//! | 5 the error metric | `metric`, of the residuals in `factors` |
//! | 6 minimising it | [`align`]: Gauss-Newton with the prior, new pairs in each iteration |

mod boundary;
mod map;
mod matching;
mod metric;
mod rejection;
mod selection;
mod weighting;

pub(crate) use boundary::boundary;
pub(crate) use map::{Map, Surface, Target};
pub use matching::Matching;
pub(crate) use matching::{Correspondence, Matcher};
pub use rejection::Rejection;
pub use selection::Selection;
pub(crate) use selection::select;
pub use weighting::{Kernel, Weight};

use super::{Method, RegisterParams};
use crate::geometry::{Mat6, Pose, Twist, Vec3, exp, log};
use metric::System;
use nalgebra::SymmetricEigen;

/// The variants of the stages that are used.
pub(crate) struct Stages {
    pub selection: Selection,
    pub matching: Matching,
    pub weight: Weight,
    pub kernel: Kernel,
    pub rejection: Rejection,
}

impl RegisterParams {
    /// The variants asked for; the thesis's method has its own.
    pub(crate) fn stages(&self) -> Stages {
        if self.method == Method::Thesis {
            return Stages {
                selection: Selection::Uniform,
                matching: Matching::Closest,
                weight: Weight::Constant,
                kernel: Kernel::None,
                rejection: Rejection::Normals,
            };
        }
        Stages {
            selection: self.selection,
            matching: self.matching,
            weight: self.weight,
            kernel: self.kernel,
            rejection: self.rejection,
        }
    }
}

/// Selected points of the scan that moves, in its sensor frame.
#[derive(Clone, Copy)]
pub(crate) struct Moving<'a> {
    pub points: &'a [Vec3],
    pub normals: &'a [Vec3],
    /// Unit vectors along their rays, away from the sensor.
    pub rays: &'a [Vec3],
    /// Standard deviation of a point-to-plane residual, metres.
    pub noise: f64,
}

impl<'a> Moving<'a> {
    /// The first `count` points.
    fn first(&self, count: usize) -> Moving<'a> {
        Moving {
            points: &self.points[..count],
            normals: &self.normals[..count],
            rays: &self.rays[..count],
            noise: self.noise,
        }
    }

    /// Every `stride`-th of the points.
    pub(crate) fn every(&self, stride: usize) -> Thinned {
        let take = |of: &[Vec3]| of.iter().copied().step_by(stride).collect();
        Thinned { points: take(self.points), normals: take(self.normals), rays: take(self.rays) }
    }
}

/// Some of a scan's points.
pub(crate) struct Thinned {
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
    rays: Vec<Vec3>,
}

impl Thinned {
    /// As what is aligned, with residuals of deviation `noise` (metres).
    pub(crate) fn moving(&self, noise: f64) -> Moving<'_> {
        Moving { points: &self.points, normals: &self.normals, rays: &self.rays, noise }
    }
}

/// What is believed of the pose before the scan is looked at.
#[derive(Clone, Copy)]
pub(crate) struct Prior {
    pub pose: Pose,
    pub information: Mat6,
}

impl Prior {
    /// How far `pose` is from where it is believed to be.
    pub(crate) fn off(&self, pose: &Pose) -> Twist {
        log(&(self.pose.inverse() * pose))
    }

    /// The square of that in standard deviations (Mahalanobis).
    pub(crate) fn off_squared(&self, pose: &Pose) -> f64 {
        let off = self.off(pose);
        off.dot(&(self.information * off))
    }
}

/// The schedule of the search radius, metres.
#[derive(Clone, Copy)]
pub(crate) struct Radius {
    pub start: f64,
    pub end: f64,
}

/// The outcome of one alignment.
#[derive(Clone, Debug)]
pub(crate) struct Alignment {
    pub pose: Pose,
    pub correspondences: usize,
    pub rmse: f64,
    pub converged: bool,
    /// Information that the correspondences alone give.
    pub information: Mat6,
}

/// The radius shrinks to its end by this factor an iteration: slow enough to follow the alignment.
const SHRINK: f64 = 0.75;
/// As many points find the way.
const SCOUTS: usize = 500;
/// A step below this many standard deviations of the pose does not matter any more.
const SMALL_STEP: f64 = 0.1;

/// Aligns `moving` to the map from where the prior believes it. Some of the points find the way, if there are many; then all
/// of them say where exactly.
pub(crate) fn align(
    moving: &Moving,
    map: &Map,
    prior: &Prior,
    radius: Radius,
    params: &RegisterParams,
) -> Alignment {
    let stride = moving.points.len() / SCOUTS;
    if stride < 2 || params.method == Method::Thesis {
        return descend(moving, map, prior, &prior.pose, radius, params);
    }
    let scouts = moving.every(stride);
    let found = descend(&scouts.moving(moving.noise), map, prior, &prior.pose, radius, params);
    let near = Radius { start: radius.end, end: radius.end };
    descend(moving, map, prior, &found.pose, near, params)
}

/// From `start` to where the prior and the pairs within the shrinking radius agree.
fn descend(
    moving: &Moving,
    map: &Map,
    prior: &Prior,
    start: &Pose,
    radius: Radius,
    params: &RegisterParams,
) -> Alignment {
    let thesis = params.method == Method::Thesis;
    let mut rounds = Rounds::new(*moving, map, params);
    let mut pose = *start;
    let mut reach = radius.start;
    let mut converged = false;
    let mut system = rounds.next(&pose, reach);
    for _ in 0..params.max_iterations {
        let (mut hessian, mut gradient) = (system.hessian, system.gradient);
        if !thesis {
            // The derivative of log(T0^-1 T exp(xi)) by xi is the identity to first order in the correction.
            hessian += prior.information;
            gradient += prior.information * prior.off(&pose);
        }
        let Some(step) = solve(&hessian, &gradient) else { break };
        pose *= exp(&step);
        let small = step.dot(&(hessian * step)) < SMALL_STEP * SMALL_STEP;
        let at_end = reach <= radius.end && rounds.all_taken();
        reach = (reach * SHRINK).max(radius.end);
        system = rounds.next(&pose, reach);
        if small && at_end {
            converged = true;
            break;
        }
    }
    let System { hessian, rmse, count, .. } = system;
    Alignment { pose, correspondences: count, rmse, converged, information: hessian }
}

/// Stages 2 to 5, iteration by iteration.
struct Rounds<'a> {
    moving: Moving<'a>,
    map: &'a Map,
    params: &'a RegisterParams,
    iteration: usize,
    taken: usize,
    matcher: Matcher<'a>,
}

impl<'a> Rounds<'a> {
    fn new(moving: Moving<'a>, map: &'a Map, params: &'a RegisterParams) -> Rounds<'a> {
        let taken = selection::taken(params.stages().selection, moving.points.len(), 0);
        let matcher = Matcher::new(moving.first(taken), map, params);
        Rounds { moving, map, params, iteration: 0, taken, matcher }
    }

    fn all_taken(&self) -> bool {
        self.taken == self.moving.points.len()
    }

    /// The system at `pose` of the pairs within `reach`.
    fn next(&mut self, pose: &Pose, reach: f64) -> System {
        let all = self.moving.points.len();
        let taken = selection::taken(self.params.stages().selection, all, self.iteration);
        if taken != self.taken {
            self.taken = taken;
            self.matcher = Matcher::new(self.moving.first(taken), self.map, self.params);
        }
        self.iteration += 1;
        let mut found = self.matcher.find(pose, reach);
        rejection::reject(&mut found, self.params);
        System::new(&found, &self.moving, pose, self.params)
    }
}

fn solve(hessian: &Mat6, gradient: &Twist) -> Option<Twist> {
    // A direction without any information (less than 1e-12 of the best) must not move.
    let eigen = SymmetricEigen::new(*hessian);
    let largest = eigen.eigenvalues.max();
    if !(largest.is_finite() && largest > 0.0) {
        return None;
    }
    let mut step = Twist::zeros();
    for (i, &value) in eigen.eigenvalues.iter().enumerate() {
        if value > 1e-12 * largest {
            let direction = eigen.eigenvectors.column(i);
            step -= direction * (direction.dot(gradient) / value);
        }
    }
    Some(step)
}

/// Pairs that count of the scan's points at `pose` and the map's within `reach` (metres).
pub(crate) fn correspondences(
    moving: &Moving,
    map: &Map,
    pose: &Pose,
    reach: f64,
    params: &RegisterParams,
) -> Vec<Correspondence> {
    let mut found = Matcher::new(*moving, map, params).find(pose, reach);
    rejection::reject(&mut found, params);
    found
}

/// The normal for which the curvature of the surface between two points cancels, so that the distance is right to
/// third order (Rusinkiewicz 2019, A Symmetric Objective Function for ICP); `agreement` is `a . b`.
pub(crate) fn halfway(a: &Vec3, b: &Vec3, agreement: f64) -> Vec3 {
    (a + b) / (1.0 + agreement)
}
