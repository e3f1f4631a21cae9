//! Point-to-plane ICP of points onto a surface (Chen & Medioni 1992; Low 2004, Linear Least-Squares Optimization
//! for Point-to-Plane ICP Surface Registration, eq. (8)), from the identity and without a radius.

use super::reference::Reference;
use crate::geometry::{Mat6, Pose, Twist, Vec3};
use crate::{Progress, Result};
use nalgebra::{Translation3, UnitQuaternion};
use rayon::prelude::*;

/// Relative damping: a direction that the surface does not constrain stays where it is, one that it constrains ever
/// so weakly still converges.
const DAMPING: f64 = 1e-6;
/// Coarse stage: every n-th point is enough to come close.
const STRIDE: usize = 10;
/// Points of one partial sum; fixed, so that the sum does not depend on the number of threads.
const CHUNK: usize = 1024;

/// The rigid transform that [`align`] found.
#[derive(Clone, Copy, Debug)]
pub struct Alignment {
    /// `surface_from_points`.
    pub pose: Pose,
    /// Whether the last step was below 1e-7 of the points' extent.
    pub converged: bool,
    /// Steps taken, both stages together.
    pub iterations: usize,
}

/// Aligns `points` to `surface`: Gauss-Newton on the squared distances along the normals of the nearest triangles;
/// first with every tenth point, then with all. Points nearest to the surface's boundary have no counterpart on it
/// and are left out (Turk & Levoy 1994, Zippered Polygon Meshes, §4).
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn align(points: &[Vec3], surface: &Reference, progress: &Progress) -> Result<Alignment> {
    let mut alignment = Alignment { pose: Pose::identity(), converged: false, iterations: 0 };
    let few: Vec<Vec3> = points.iter().step_by(STRIDE).copied().collect();
    let stages: [(&[Vec3], f64, usize); 2] = [(&few, 1e-5, 60), (points, 1e-7, 30)];
    for (points, tolerance, most) in stages {
        alignment.converged = false;
        for _ in 0..most {
            progress.report("align", 0.5)?;
            let Some((step, moved)) = step(points, &alignment.pose, surface) else { break };
            alignment.pose = step * alignment.pose;
            alignment.iterations += 1;
            if moved < tolerance {
                alignment.converged = true;
                break;
            }
        }
    }
    Ok(alignment)
}

/// One step: the transform to apply on the left, and how far it moves the points relative to their extent.
fn step(points: &[Vec3], pose: &Pose, surface: &Reference) -> Option<(Pose, f64)> {
    let frame = Frame::of(points, pose)?;
    let (mut hessian, mut gradient) = (Mat6::zeros(), Twist::zeros());
    let partial: Vec<(Mat6, Twist)> = points
        .par_chunks(CHUNK)
        .map(|chunk| {
            let (mut hessian, mut gradient) = (Mat6::zeros(), Twist::zeros());
            for point in chunk {
                let moved = apply(pose, point);
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
    let damping = DAMPING * hessian.diagonal().max();
    let xi = -(hessian + Mat6::identity() * damping).cholesky()?.solve(&gradient);
    Some((frame.transform(&xi), xi.norm() / frame.radius))
}

/// Where a small motion is expressed: rotations about the points' centre, in units of arc length at their mean
/// radius, so that all six coordinates are lengths of like effect.
pub(crate) struct Frame {
    center: Vec3,
    radius: f64,
}

impl Frame {
    /// The frame of `points` after `pose`; `None` if they coincide.
    pub(crate) fn of(points: &[Vec3], pose: &Pose) -> Option<Frame> {
        let n = points.len() as f64;
        let center = points.iter().sum::<Vec3>() / n;
        let square = points.iter().map(|p| (p - center).norm_squared()).sum::<f64>() / n;
        (square > 0.0).then(|| Frame { center: apply(pose, &center), radius: square.sqrt() })
    }

    /// Derivative of `normal . point` by the motion (x, y, z, rotations times radius).
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

/// The point in the transform's target frame.
pub(crate) fn apply(pose: &Pose, point: &Vec3) -> Vec3 {
    pose.rotation * point + pose.translation.vector
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
            .map(|s| apply(&motion, &s.point))
            .collect();
        let reference = Reference::new(&truth).unwrap();
        let found = align(&points, &reference, &Progress::silent()).unwrap();
        assert!(found.converged);
        assert!(log(&(found.pose * motion)).norm() < 1e-6);
    }

    #[test]
    fn a_sphere_shifts_but_does_not_turn() {
        let truth = sphere(0.1, 5);
        let points: Vec<Vec3> = truth.vertices.iter().map(|v| v + Vec3::x() * 0.01).collect();
        let reference = Reference::new(&truth).unwrap();
        let pose = align(&points, &reference, &Progress::silent()).unwrap().pose;
        assert!((pose.translation.vector + Vec3::x() * 0.01).norm() < 1e-4);
        assert!(pose.rotation.angle() < 0.02);
    }

    #[test]
    fn the_jacobian_is_that_of_finite_differences() {
        let points =
            [Vec3::new(0.1, 0.2, 0.3), Vec3::new(-0.2, 0.1, 0.0), Vec3::new(0.0, 0.4, 0.1)];
        let frame = Frame::of(&points, &Pose::identity()).unwrap();
        let normal = Vec3::new(0.2, -0.5, 0.7).normalize();
        let jacobian = frame.jacobian(&points[0], &normal);
        for i in 0..6 {
            let mut xi = Twist::zeros();
            xi[i] = 1e-6;
            let value = |xi: &Twist| normal.dot(&apply(&frame.transform(xi), &points[0]));
            let difference = (value(&xi) - value(&-xi)) / 2e-6;
            assert!((difference - jacobian[i]).abs() < 1e-8);
        }
    }
}
