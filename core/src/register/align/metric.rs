//! Stage 5: the error that is minimised (Rusinkiewicz & Levoy 2001, §3.5), as Hessian and gradient of
//!
//! ```text
//! sum_i w_i k(r_i / s) r_i' M_i r_i / 2                                                         (1)
//! ```
//!
//! with residuals r_i, their information M_i, weights w_i and the robust kernel k (reweighted least squares).

use super::Moving;
use super::matching::Correspondence;
use crate::geometry::{MAD_TO_SIGMA, Mat6, Pose, Twist, median};
use crate::register::factors::{combined_information, point_to_plane, point_to_point};
use crate::register::{Method, RegisterParams};

/// Sums over the correspondences.
pub(crate) struct System {
    pub hessian: Mat6,
    pub gradient: Twist,
    /// Root mean square residual, metres: along the normals, for the thesis between the points.
    pub rmse: f64,
    /// Correspondences that count.
    pub count: usize,
}

/// The median length of a vector of three independent normal deviates (chi distribution).
const MEDIAN_LENGTH: f64 = 1.538;

impl System {
    /// The sums over `found`, pairs of `moving` at `pose`.
    pub(crate) fn new(
        found: &[Correspondence],
        moving: &Moving,
        pose: &Pose,
        params: &RegisterParams,
    ) -> System {
        if params.method == Method::Thesis {
            return System::of_thesis(found, pose, moving.noise);
        }
        let scale = scale(found, params.method).max(moving.noise);
        let stages = params.stages();
        let weights = stages.weight.of(found, moving);
        let mut system = System::empty();
        let (mut squares, mut total) = (0.0, 0.0);
        for (c, weight) in found.iter().zip(weights) {
            let mut term = Term::of(c, pose, params.method);
            let weight = weight * stages.kernel.weight(term.squared.sqrt() / scale);
            term.scale(params.information_share * weight / (scale * scale));
            system.hessian += term.hessian;
            system.gradient += term.gradient;
            squares += weight * c.distance * c.distance;
            total += weight;
            system.count += usize::from(weight > 0.0);
        }
        system.rmse = (squares / f64::max(total, f64::MIN_POSITIVE)).sqrt();
        system
    }

    fn of_thesis(found: &[Correspondence], pose: &Pose, noise: f64) -> System {
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

    fn empty() -> System {
        System { hessian: Mat6::zeros(), gradient: Twist::zeros(), rmse: 0.0, count: 0 }
    }
}

/// Robust standard deviation of the residuals, metres. While the scan is still off, they are misalignment, not noise:
/// the kernel is as wide as they are.
fn scale(found: &[Correspondence], method: Method) -> f64 {
    let middle = |of: fn(&Correspondence) -> f64| median(found.iter().map(of).collect());
    match method {
        Method::PointToPoint => middle(|c| c.gap).unwrap_or(0.0) / MEDIAN_LENGTH,
        _ => MAD_TO_SIGMA * middle(|c| c.distance.abs()).unwrap_or(0.0),
    }
}

/// One term of (1) for residuals of standard deviation 1 m.
struct Term {
    hessian: Mat6,
    gradient: Twist,
    /// `r' M r`, square metres.
    squared: f64,
}

impl Term {
    fn of(c: &Correspondence, pose: &Pose, method: Method) -> Term {
        match method {
            Method::PlaneToPlane => {
                let (r, jacobian) = point_to_point(pose, &c.point, &c.target);
                let information = combined_information(&c.here, &c.there);
                let weighted = jacobian.transpose() * information;
                Term {
                    hessian: weighted * jacobian,
                    gradient: weighted * r,
                    squared: r.dot(&(information * r)).max(0.0),
                }
            }
            Method::PointToPoint | Method::Thesis => {
                let (r, jacobian) = point_to_point(pose, &c.point, &c.target);
                let transposed = jacobian.transpose();
                Term {
                    hessian: transposed * jacobian,
                    gradient: transposed * r,
                    squared: r.norm_squared(),
                }
            }
            Method::PointToPlane => {
                let (r, jacobian) = point_to_plane(pose, &c.point, &c.target, &c.normal);
                Term {
                    hessian: jacobian * jacobian.transpose(),
                    gradient: jacobian * r,
                    squared: r * r,
                }
            }
        }
    }

    fn scale(&mut self, factor: f64) {
        self.hessian *= factor;
        self.gradient *= factor;
    }
}
