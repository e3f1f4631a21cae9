//! One scan onto the map: iterative closest points, with the robot's pose as prior.

use super::factors::{point_to_plane, point_to_point, tukey};
use super::{Method, RegisterParams};
use crate::geometry::{KdTree, Mat6, Pose, Twist, Vec3, exp, log};
use nalgebra::SymmetricEigen;
use rayon::prelude::*;

/// Oriented points in the object frame that scans are aligned to.
pub(crate) struct Map {
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
    tree: KdTree,
}

impl Map {
    pub(crate) fn new(points: Vec<Vec3>, normals: Vec<Vec3>) -> Map {
        let tree = KdTree::new(&points);
        Map { points, normals, tree }
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

/// Sums of one pass over the correspondences.
struct Normal {
    hessian: Mat6,
    gradient: Twist,
    squares: f64,
    weight: f64,
    count: usize,
}

/// The radius shrinks to its end by this factor an iteration: slow enough to follow the alignment.
const SHRINK: f64 = 0.8;

pub(crate) fn align(
    moving: &Moving,
    map: &Map,
    prior: &Prior,
    radius: Radius,
    params: &RegisterParams,
) -> Alignment {
    let thesis = params.method == Method::Thesis;
    let mut pose = prior.pose;
    let mut reach = if thesis { radius.start } else { radius.start.max(radius.end) };
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
        let small = step.fixed_rows::<3>(0).norm() < 1e-6 && step.fixed_rows::<3>(3).norm() < 1e-5;
        let at_end = thesis || reach <= radius.end;
        reach = if thesis { reach } else { (reach * SHRINK).max(radius.end) };
        system = assemble(moving, map, &pose, reach, params);
        if small && at_end {
            converged = true;
            break;
        }
    }
    Alignment {
        pose,
        correspondences: system.count,
        rmse: (system.squares / system.weight.max(f64::MIN_POSITIVE)).sqrt(),
        converged,
        information: system.hessian,
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

fn assemble(
    moving: &Moving,
    map: &Map,
    pose: &Pose,
    reach: f64,
    params: &RegisterParams,
) -> Normal {
    let cosine = params.max_normal_angle.cos();
    // While the radius is wide, so is the kernel: residuals are misalignment then, not noise.
    let scale = moving.noise.max(reach / 4.685);
    let information = params.information_share / (moving.noise * moving.noise);
    // Chunks of fixed size are summed in their order, so the result does not depend on the threads.
    let partial: Vec<Normal> = moving
        .points
        .par_chunks(512)
        .zip(moving.normals.par_chunks(512))
        .map(|(points, normals)| {
            let mut sum = Normal::zero();
            for (p, normal) in points.iter().zip(normals) {
                let moved = pose.rotation * p + pose.translation.vector;
                let Some((index, _)) = map.tree.nearest_within(&moved, reach) else { continue };
                if map.normals[index].dot(&(pose.rotation * normal)) < cosine {
                    continue;
                }
                sum.add(
                    pose,
                    p,
                    &map.points[index],
                    &map.normals[index],
                    scale,
                    information,
                    params.method,
                );
            }
            sum
        })
        .collect();
    partial.into_iter().fold(Normal::zero(), Normal::plus)
}

impl Normal {
    fn zero() -> Normal {
        Normal {
            hessian: Mat6::zeros(),
            gradient: Twist::zeros(),
            squares: 0.0,
            weight: 0.0,
            count: 0,
        }
    }

    #[allow(clippy::too_many_arguments)] // one correspondence and how it counts
    fn add(
        &mut self,
        pose: &Pose,
        p: &Vec3,
        m: &Vec3,
        n: &Vec3,
        scale: f64,
        information: f64,
        method: Method,
    ) {
        let weight = match method {
            Method::Thesis => {
                let (r, jacobian) = point_to_point(pose, p, m);
                self.hessian += jacobian.transpose() * jacobian * information;
                self.gradient += jacobian.transpose() * r * information;
                self.squares += r.norm_squared();
                1.0
            }
            Method::PointToPlane => {
                let (r, jacobian) = point_to_plane(pose, p, m, n);
                let weight = tukey(r / scale);
                self.hessian += jacobian * jacobian.transpose() * (information * weight);
                self.gradient += jacobian * (r * information * weight);
                self.squares += weight * r * r;
                weight
            }
        };
        self.weight += weight;
        self.count += usize::from(weight > 0.0);
    }

    fn plus(self, other: Normal) -> Normal {
        Normal {
            hessian: self.hessian + other.hessian,
            gradient: self.gradient + other.gradient,
            squares: self.squares + other.squares,
            weight: self.weight + other.weight,
            count: self.count + other.count,
        }
    }
}
