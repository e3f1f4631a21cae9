//! Point-to-plane ICP of points onto a surface (Chen & Medioni 1992; Low 2004, Linear Least-Squares
//! Optimization for Point-to-Plane ICP Surface Registration, eq. (8)).
//!
//! The iteration starts at the identity and pairs each point with the nearest point of the surface,
//! however far away it is.

use super::reference_surface::ReferenceSurface;
use crate::geometry::{Mat6, Pose, Twist, Vec3, transform};
use crate::{Progress, Result};
use nalgebra::{Translation3, UnitQuaternion};
use rayon::prelude::*;

/// Damping relative to the largest diagonal element of the Hessian. A direction that the surface
/// does not constrain is not moved; a weakly constrained one still converges.
const DAMPING_RATIO: f64 = 1e-6;
/// The coarse stage uses every n-th point, which is enough to come close.
const COARSE_STRIDE: usize = 10;
/// Points in one partial sum. It is fixed so that sums do not depend on the number of threads.
const CHUNK_POINTS: usize = 1024;
/// The coarse stage ends when a step is below this share of the points' extent.
const COARSE_TOLERANCE_RATIO: f64 = 1e-5;
/// The fine stage ends when a step is below this share of the points' extent.
const FINE_TOLERANCE_RATIO: f64 = 1e-7;
/// Limit of the steps of the coarse stage.
const MAX_COARSE_STEPS: usize = 60;
/// Limit of the steps of the fine stage, which starts near its solution.
const MAX_FINE_STEPS: usize = 30;
/// Fraction that is reported throughout: the number of steps is not known beforehand.
const REPORTED_FRACTION: f64 = 0.5;

/// The rigid transform that [`align_to_surface`] found.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceAlignment {
    /// `surface_from_points`.
    pub pose: Pose,
    /// Whether the last step was below 1e-7 of the points' extent.
    pub converged: bool,
    /// Number of steps of both stages together.
    pub iterations: usize,
}

/// Aligns `points` (metres) to `surface`.
///
/// Gauss-Newton steps minimise the squared distances along the normals of the nearest triangles,
/// first with every tenth point, then with all. Points whose nearest point lies on the surface's
/// boundary have no counterpart on it and are left out (Turk & Levoy 1994, Zippered Polygon Meshes,
/// §4).
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn align_to_surface(
    points: &[Vec3],
    surface: &ReferenceSurface,
    progress: &Progress,
) -> Result<SurfaceAlignment> {
    let mut alignment =
        SurfaceAlignment { pose: Pose::identity(), converged: false, iterations: 0 };
    let few: Vec<Vec3> = points.iter().step_by(COARSE_STRIDE).copied().collect();
    let stages = [
        Stage {
            points: &few,
            tolerance_ratio: COARSE_TOLERANCE_RATIO,
            max_steps: MAX_COARSE_STEPS,
        },
        Stage { points, tolerance_ratio: FINE_TOLERANCE_RATIO, max_steps: MAX_FINE_STEPS },
    ];
    for stage in stages {
        alignment.converged = false;
        for _ in 0..stage.max_steps {
            progress.report("align", REPORTED_FRACTION)?;
            let step = gauss_newton_step(stage.points, &alignment.pose, surface);
            let Some((motion, moved_ratio)) = step else { break };
            alignment.pose = motion * alignment.pose;
            alignment.iterations += 1;
            if moved_ratio < stage.tolerance_ratio {
                alignment.converged = true;
                break;
            }
        }
    }
    Ok(alignment)
}

/// A part of the iteration.
struct Stage<'a> {
    points: &'a [Vec3],
    /// The stage ends when a step is below this share of the points' extent.
    tolerance_ratio: f64,
    max_steps: usize,
}

/// Returns the transform to apply on the left, and how far it moves the points relative to their
/// extent.
///
/// `None` if the points coincide or no point has a counterpart on the surface.
fn gauss_newton_step(
    points: &[Vec3],
    pose: &Pose,
    surface: &ReferenceSurface,
) -> Option<(Pose, f64)> {
    let frame = NormalizedFrame::new(points, pose)?;
    let (mut hessian, mut gradient) = (Mat6::zeros(), Twist::zeros());
    let partial: Vec<(Mat6, Twist)> = points
        .par_chunks(CHUNK_POINTS)
        .map(|chunk| {
            let (mut hessian, mut gradient) = (Mat6::zeros(), Twist::zeros());
            for point in chunk {
                let moved = transform(pose, point);
                let nearest = surface.nearest(&moved);
                if nearest.on_boundary {
                    continue;
                }
                let jacobian = frame.jacobian(&moved, &nearest.normal);
                hessian += jacobian * jacobian.transpose();
                gradient += jacobian * nearest.normal.dot(&(moved - nearest.point));
            }
            (hessian, gradient)
        })
        .collect();
    for (h, g) in &partial {
        hessian += h;
        gradient += g;
    }
    let damping = DAMPING_RATIO * hessian.diagonal().max();
    let xi = -(hessian + Mat6::identity() * damping).cholesky()?.solve(&gradient);
    Some((frame.transform(&xi), xi.norm() / frame.radius))
}

/// The coordinates of a small motion. Rotations are about the points' centroid and measured in arc
/// length at the points' root mean square radius, so that all six coordinates are lengths of
/// similar effect.
pub(crate) struct NormalizedFrame {
    center: Vec3,
    radius: f64,
}

impl NormalizedFrame {
    /// The frame of `points` moved by `pose`; `None` if the points coincide.
    pub(crate) fn new(points: &[Vec3], pose: &Pose) -> Option<NormalizedFrame> {
        let n = points.len() as f64;
        let center = points.iter().sum::<Vec3>() / n;
        let square = points.iter().map(|p| (p - center).norm_squared()).sum::<f64>() / n;
        (square > 0.0)
            .then(|| NormalizedFrame { center: transform(pose, &center), radius: square.sqrt() })
    }

    /// Derivative of `normal . point` with respect to the motion (x, y, z, rotations times radius).
    pub(crate) fn jacobian(&self, point: &Vec3, normal: &Vec3) -> Twist {
        let turn = (point - self.center).cross(normal) / self.radius;
        Twist::new(normal.x, normal.y, normal.z, turn.x, turn.y, turn.z)
    }

    /// The rigid transform of the motion `xi`.
    fn transform(&self, xi: &Twist) -> Pose {
        let shift = Vec3::new(xi[0], xi[1], xi[2]);
        let rotation = UnitQuaternion::new(Vec3::new(xi[3], xi[4], xi[5]) / self.radius);
        let translation = self.center + shift - rotation * self.center;
        Pose::from_parts(Translation3::from(translation), rotation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{exp, log};
    use crate::mesh::test_shapes::{cuboid, sphere};

    #[test]
    fn a_moved_box_comes_back() {
        let truth = cuboid(Vec3::zeros(), Vec3::new(0.1, 0.07, 0.05));
        let motion = exp(&Twist::new(0.003, -0.002, 0.004, 0.04, -0.03, 0.05));
        let points: Vec<Vec3> = super::super::sample_surface(&truth, 5000, 1, 0)
            .unwrap()
            .iter()
            .map(|s| transform(&motion, &s.point))
            .collect();
        let reference = ReferenceSurface::new(&truth).unwrap();
        let found = align_to_surface(&points, &reference, &Progress::silent()).unwrap();
        assert!(found.converged);
        assert!(log(&(found.pose * motion)).norm() < 1e-6);
    }

    #[test]
    fn a_sphere_shifts_but_does_not_turn() {
        let truth = sphere(0.1, 5);
        let points: Vec<Vec3> = truth.vertices.iter().map(|v| v + Vec3::x() * 0.01).collect();
        let reference = ReferenceSurface::new(&truth).unwrap();
        let pose = align_to_surface(&points, &reference, &Progress::silent()).unwrap().pose;
        assert!((pose.translation.vector + Vec3::x() * 0.01).norm() < 1e-4);
        assert!(pose.rotation.angle() < 0.02);
    }

    #[test]
    fn the_jacobian_is_that_of_finite_differences() {
        let points =
            [Vec3::new(0.1, 0.2, 0.3), Vec3::new(-0.2, 0.1, 0.0), Vec3::new(0.0, 0.4, 0.1)];
        let frame = NormalizedFrame::new(&points, &Pose::identity()).unwrap();
        let normal = Vec3::new(0.2, -0.5, 0.7).normalize();
        let jacobian = frame.jacobian(&points[0], &normal);
        for i in 0..6 {
            let mut xi = Twist::zeros();
            xi[i] = 1e-6;
            let [ahead, behind] =
                [xi, -xi].map(|xi| normal.dot(&transform(&frame.transform(&xi), &points[0])));
            let difference = (ahead - behind) / 2e-6;
            assert!((difference - jacobian[i]).abs() < 1e-8);
        }
    }
}
