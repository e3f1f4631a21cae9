//! One scan onto the map: iterative closest points, with the robot's pose as prior.

use super::factors::{point_to_plane, point_to_point, tukey};
use super::{Method, RegisterParams};
use crate::geometry::{KdTree, Mat6, Pose, Twist, Vec3, exp, log, median};
use crate::voxel::{Voxel, voxel_of};
use nalgebra::SymmetricEigen;
use rayon::prelude::*;
use rustc_hash::FxHashSet;

/// Oriented points in the object frame that scans are aligned to: at most one a voxel and side, so that the map
/// grows with the surface, not with the number of scans.
pub(crate) struct Map {
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
    voxel: f64,
    taken: FxHashSet<(Voxel, usize)>,
    tree: KdTree,
}

impl Map {
    /// An empty map with one point per voxel of edge `voxel` (metres).
    pub(crate) fn new(voxel: f64) -> Map {
        Map {
            points: Vec::new(),
            normals: Vec::new(),
            voxel,
            taken: FxHashSet::default(),
            tree: KdTree::new(&[]),
        }
    }

    /// Adds oriented points (sensor frame) seen from `pose`.
    pub(crate) fn insert(&mut self, points: &[Vec3], normals: &[Vec3], pose: &Pose) {
        for (p, n) in points.iter().zip(normals) {
            let (point, normal) = (pose.rotation * p + pose.translation.vector, pose.rotation * n);
            // The six sides of a cube are enough to keep the faces of a thin wall apart.
            let side = 2 * normal.iamax() + usize::from(normal[normal.iamax()] > 0.0);
            if self.taken.insert((voxel_of(&point, self.voxel), side)) {
                self.points.push(point);
                self.normals.push(normal);
            }
        }
        self.tree = KdTree::new(&self.points);
    }
}

/// Sampled points of the scan that moves, in its sensor frame.
pub(crate) struct Moving<'a> {
    pub points: &'a [Vec3],
    pub normals: &'a [Vec3],
    /// Standard deviation of a point-to-plane residual, metres.
    pub noise: f64,
}

/// What is believed of the pose before the scan is looked at.
#[derive(Clone, Copy)]
pub(crate) struct Prior {
    pub pose: Pose,
    pub information: Mat6,
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

/// A point of the scan and the point of the map that it should lie on.
pub(crate) struct Correspondence {
    point: Vec3,
    target: Vec3,
    /// Normal of the plane halfway between the two points' tangent planes, object frame.
    normal: Vec3,
    distance: f64,
}

/// Sums over the correspondences.
struct System {
    hessian: Mat6,
    gradient: Twist,
    rmse: f64,
    count: usize,
}

/// The radius shrinks to its end by this factor an iteration: slow enough to follow the alignment.
const SHRINK: f64 = 0.75;
/// A step below this many standard deviations of the pose does not matter any more.
const SMALL_STEP: f64 = 0.1;

pub(crate) fn align(
    moving: &Moving,
    map: &Map,
    prior: &Prior,
    radius: Radius,
    params: &RegisterParams,
) -> Alignment {
    let thesis = params.method == Method::Thesis;
    let mut pose = prior.pose;
    let mut reach = radius.start;
    let mut converged = false;
    let mut system = assemble(moving, map, &pose, reach, params);
    for _ in 0..params.max_iterations {
        let (mut hessian, mut gradient) = (system.hessian, system.gradient);
        if !thesis {
            // The derivative of log(T0^-1 T exp(xi)) by xi is the identity to first order in the correction.
            hessian += prior.information;
            gradient += prior.information * log(&(prior.pose.inverse() * pose));
        }
        let Some(step) = solve(&hessian, &gradient) else { break };
        pose *= exp(&step);
        let small = step.dot(&(hessian * step)) < SMALL_STEP * SMALL_STEP;
        let at_end = reach <= radius.end;
        reach = (reach * SHRINK).max(radius.end);
        system = assemble(moving, map, &pose, reach, params);
        if small && at_end {
            converged = true;
            break;
        }
    }
    let System { hessian, rmse, count, .. } = system;
    Alignment { pose, correspondences: count, rmse, converged, information: hessian }
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

/// Pairs of the scan's points at `pose` and the map's within `reach`, normals alike.
pub(crate) fn correspondences(
    moving: &Moving,
    map: &Map,
    pose: &Pose,
    reach: f64,
    params: &RegisterParams,
) -> Vec<Correspondence> {
    let cosine = params.max_normal_angle.cos();
    let find = |(p, normal): (&Vec3, &Vec3)| {
        let moved = pose.rotation * p + pose.translation.vector;
        let (index, _) = map.tree.nearest_within(&moved, reach)?;
        let (target, there) = (map.points[index], map.normals[index]);
        let here = pose.rotation * normal;
        let agreement = there.dot(&here);
        if agreement < cosine {
            return None;
        }
        let normal = halfway(&there, &here, agreement);
        Some(Correspondence { point: *p, target, normal, distance: normal.dot(&(moved - target)) })
    };
    moving.points.par_iter().zip(moving.normals).filter_map(find).collect()
}

/// The normal for which the curvature of the surface between two points cancels, so that the distance is right to
/// third order (Rusinkiewicz 2019, A Symmetric Objective Function for ICP); `agreement` is `a . b`.
pub(crate) fn halfway(a: &Vec3, b: &Vec3, agreement: f64) -> Vec3 {
    (a + b) / (1.0 + agreement)
}

fn assemble(
    moving: &Moving,
    map: &Map,
    pose: &Pose,
    reach: f64,
    params: &RegisterParams,
) -> System {
    let found = correspondences(moving, map, pose, reach, params);
    if params.method == Method::Thesis {
        return point_to_point_system(&found, pose, moving.noise);
    }
    // While the scan is still off, the residuals are misalignment, not noise: the kernel is as wide as they are.
    let spread = median(found.iter().map(|c| c.distance.abs()).collect()).unwrap_or(0.0);
    let scale = (1.4826 * spread).max(moving.noise);
    let information = params.information_share / (scale * scale);
    let mut system = System::empty();
    let (mut squares, mut total) = (0.0, 0.0);
    for c in &found {
        let (r, jacobian) = point_to_plane(pose, &c.point, &c.target, &c.normal);
        let weight = tukey(r / scale);
        system.hessian += jacobian * jacobian.transpose() * (information * weight);
        system.gradient += jacobian * (r * information * weight);
        squares += weight * r * r;
        total += weight;
        system.count += usize::from(weight > 0.0);
    }
    system.rmse = (squares / f64::max(total, f64::MIN_POSITIVE)).sqrt();
    system
}

fn point_to_point_system(found: &[Correspondence], pose: &Pose, noise: f64) -> System {
    let mut system = System::empty();
    let information = 1.0 / (noise * noise);
    for c in found {
        let (r, jacobian) = point_to_point(pose, &c.point, &c.target);
        system.hessian += jacobian.transpose() * jacobian * information;
        system.gradient += jacobian.transpose() * r * information;
        system.rmse += r.norm_squared() / found.len() as f64;
    }
    system.rmse = system.rmse.sqrt();
    system.count = found.len();
    system
}

impl System {
    fn empty() -> System {
        System { hessian: Mat6::zeros(), gradient: Twist::zeros(), rmse: 0.0, count: 0 }
    }
}
