//! Stage 5: the error that is minimised (Rusinkiewicz & Levoy 2001, §3.5), as Hessian and gradient
//! of
//!
//! ```text
//! sum_i w_i k(r_i / s) r_i' M_i r_i / 2                                                       (1)
//! ```
//!
//! with residuals r_i, their information M_i, weights w_i and the robust kernel k (iteratively
//! reweighted least squares: the weights are held while a step is computed).

use super::factors::{combined_information, point_to_plane, point_to_point};
use super::matching::Correspondence;
use super::source::Source;
use crate::geometry::{MAD_TO_SIGMA, Mat6, Pose, Twist, median};
use crate::register::strategy::{Metric, ResidualKind, Strategy};

/// The median length of a vector of three independent normal deviates (chi distribution).
const CHI_3_MEDIAN: f64 = 1.538;

/// The normal equations of (1), summed over the correspondences.
pub(crate) struct NormalEquations {
    /// Gauss-Newton approximation of the Hessian by the twist of the pose.
    pub hessian: Mat6,
    /// Gradient by the twist of the pose.
    pub gradient: Twist,
    /// Root mean square residual, metres: along the normals, for [`Metric::SquaredDistances`]
    /// between the points.
    pub rmse: f64,
    /// Correspondences that count.
    pub count: usize,
}

impl NormalEquations {
    /// The sums over `pairs` of the points `source` at `pose`.
    pub(crate) fn new(
        pairs: &[Correspondence],
        source: &Source,
        pose: &Pose,
        strategy: &Strategy,
    ) -> NormalEquations {
        match strategy.metric {
            Metric::Weighted(kind) => {
                NormalEquations::weighted(pairs, source, pose, kind, strategy)
            }
            Metric::SquaredDistances => {
                NormalEquations::squared_distances(pairs, pose, source.noise)
            }
        }
    }

    fn weighted(
        pairs: &[Correspondence],
        source: &Source,
        pose: &Pose,
        kind: ResidualKind,
        strategy: &Strategy,
    ) -> NormalEquations {
        let scale = residual_sigma(pairs, kind).max(source.noise);
        let weights = strategy.weight.weigh(pairs, source);
        let mut sum = NormalEquations::zero();
        let (mut squares, mut total) = (0.0, 0.0);
        for (pair, weight) in pairs.iter().zip(weights) {
            let mut term = Term::new(pair, pose, kind);
            let weight = weight * strategy.kernel.weight(term.squared.sqrt() / scale);
            term.scale(strategy.params.information_share * weight / (scale * scale));
            sum.hessian += term.hessian; // (1)
            sum.gradient += term.gradient;
            squares += weight * pair.plane_distance * pair.plane_distance;
            total += weight;
            sum.count += usize::from(weight > 0.0);
        }
        sum.rmse = (squares / f64::max(total, f64::MIN_POSITIVE)).sqrt();
        sum
    }

    fn squared_distances(pairs: &[Correspondence], pose: &Pose, noise: f64) -> NormalEquations {
        let mut sum = NormalEquations::zero();
        let information = 1.0 / (noise * noise);
        for pair in pairs {
            let (r, jacobian) = point_to_point(pose, &pair.point, &pair.target);
            sum.hessian += jacobian.transpose() * jacobian * information;
            sum.gradient += jacobian.transpose() * r * information;
            sum.rmse += r.norm_squared() / pairs.len() as f64;
        }
        sum.rmse = sum.rmse.sqrt();
        sum.count = pairs.len();
        sum
    }

    fn zero() -> NormalEquations {
        NormalEquations { hessian: Mat6::zeros(), gradient: Twist::zeros(), rmse: 0.0, count: 0 }
    }
}

/// Robust standard deviation of the residuals, metres. While the scan is still away from its place,
/// they are misalignment, not noise: the kernel is as wide as they are.
fn residual_sigma(pairs: &[Correspondence], kind: ResidualKind) -> f64 {
    match kind {
        ResidualKind::PointToPoint => {
            median(pairs.iter().map(|c| c.point_distance).collect()).unwrap_or(0.0) / CHI_3_MEDIAN
        }
        ResidualKind::PointToPlane | ResidualKind::PlaneToPlane => {
            let distances = pairs.iter().map(|c| c.plane_distance.abs());
            MAD_TO_SIGMA * median(distances.collect()).unwrap_or(0.0)
        }
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
    fn new(c: &Correspondence, pose: &Pose, kind: ResidualKind) -> Term {
        match kind {
            ResidualKind::PlaneToPlane => {
                let (r, jacobian) = point_to_point(pose, &c.point, &c.target);
                let information = combined_information(&c.source_normal, &c.target_normal);
                let weighted = jacobian.transpose() * information;
                Term {
                    hessian: weighted * jacobian,
                    gradient: weighted * r,
                    squared: r.dot(&(information * r)).max(0.0),
                }
            }
            ResidualKind::PointToPoint => {
                let (r, jacobian) = point_to_point(pose, &c.point, &c.target);
                let transposed = jacobian.transpose();
                Term {
                    hessian: transposed * jacobian,
                    gradient: transposed * r,
                    squared: r.norm_squared(),
                }
            }
            ResidualKind::PointToPlane => {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Vec3, exp, transform};
    use crate::register::params::{Kernel, RegisterParams, RegistrationMethod};

    const STEP: f64 = 1e-6;
    /// Standard deviation of a residual in these tests, metres: larger than all residuals, so that
    /// the scale of (1) does not depend on the pose.
    const NOISE: f64 = 0.5;

    fn pose() -> Pose {
        exp(&Twist::new(0.1, -0.3, 0.2, 0.4, 0.1, -0.7))
    }

    /// Pairs with residuals of some centimetres, with normals that differ by up to 20 degrees.
    fn pairs() -> Vec<Correspondence> {
        (0..12)
            .map(|i| {
                let k = f64::from(i);
                let point = Vec3::new((1.7 * k).sin(), (2.3 * k).cos(), 0.2 * k - 1.0);
                let residual = Vec3::new((0.9 * k).cos(), (3.1 * k).sin(), (k * k).cos()) * 0.03;
                let target_normal = Vec3::new((k * 1.3).cos(), (k * 0.7).sin(), 0.8).normalize();
                let tilt = Vec3::new(0.1 * (k * 2.0).sin(), 0.2 * k.cos(), 0.1);
                let source_normal = (target_normal + tilt).normalize();
                let normal =
                    (target_normal + source_normal) / (1.0 + target_normal.dot(&source_normal));
                Correspondence {
                    index: i as usize,
                    point,
                    target: transform(&pose(), &point) - residual,
                    source_normal,
                    target_normal,
                    normal,
                    plane_distance: normal.dot(&residual),
                    point_distance: residual.norm(),
                    boundary: false,
                }
            })
            .collect()
    }

    /// (1) at `pose` without a robust kernel, for constant weights, `scale` and information.
    fn cost(pairs: &[Correspondence], pose: &Pose, strategy: &Strategy) -> f64 {
        let share = strategy.params.information_share / (NOISE * NOISE);
        let squares = pairs.iter().map(|c| {
            let r = transform(pose, &c.point) - c.target;
            match strategy.metric {
                Metric::Weighted(ResidualKind::PointToPlane) => share * c.normal.dot(&r).powi(2),
                Metric::Weighted(ResidualKind::PointToPoint) => share * r.norm_squared(),
                Metric::Weighted(ResidualKind::PlaneToPlane) => {
                    share * r.dot(&(combined_information(&c.source_normal, &c.target_normal) * r))
                }
                Metric::SquaredDistances => r.norm_squared() / (NOISE * NOISE),
            }
        });
        squares.sum::<f64>() / 2.0
    }

    fn equations(pairs: &[Correspondence], pose: &Pose, strategy: &Strategy) -> NormalEquations {
        let vectors = vec![Vec3::z(); pairs.len()];
        let source = Source { points: &vectors, normals: &vectors, rays: &vectors, noise: NOISE };
        NormalEquations::new(pairs, &source, pose, strategy)
    }

    fn axis(k: usize) -> Twist {
        Twist::from_fn(|i, _| if i == k { STEP } else { 0.0 })
    }

    fn strategies(kernel: Kernel) -> Vec<Strategy> {
        [
            RegistrationMethod::PointToPlane,
            RegistrationMethod::PointToPoint,
            RegistrationMethod::PlaneToPlane,
            RegistrationMethod::Thesis,
        ]
        .into_iter()
        .map(|method| {
            Strategy::new(&RegisterParams { method, kernel, ..RegisterParams::default() })
        })
        .collect()
    }

    #[test]
    fn the_assembled_gradient_is_that_of_the_cost_by_finite_differences() {
        let pairs = pairs();
        for strategy in strategies(Kernel::None) {
            let gradient = equations(&pairs, &pose(), &strategy).gradient;
            for k in 0..6 {
                let up = cost(&pairs, &(pose() * exp(&axis(k))), &strategy);
                let down = cost(&pairs, &(pose() * exp(&-axis(k))), &strategy);
                let slope = (up - down) / (2.0 * STEP);
                let tolerance = 1e-7 * gradient.norm();
                assert!((slope - gradient[k]).abs() < tolerance, "{:?} {k}", strategy.metric);
            }
        }
    }

    #[test]
    fn a_gauss_newton_step_leads_to_the_minimum_of_small_residuals() {
        let mut pairs = pairs();
        let truth = pose() * exp(&Twist::new(1e-5, -2e-5, 1e-5, 2e-5, 1e-5, -1e-5));
        for pair in &mut pairs {
            pair.target = transform(&truth, &pair.point);
        }
        for strategy in strategies(Kernel::None) {
            let NormalEquations { hessian, gradient, .. } = equations(&pairs, &pose(), &strategy);
            let step = hessian.cholesky().unwrap().solve(&-gradient);
            let rest = crate::geometry::log(&(truth.inverse() * pose() * exp(&step)));
            assert!(rest.norm() < 1e-8, "{:?}: {rest}", strategy.metric);
        }
    }

    #[test]
    fn the_kernel_scales_each_term_of_hessian_and_gradient() {
        let mut pairs = pairs();
        pairs.truncate(1);
        let scale = 0.02;
        let vectors = [Vec3::z()];
        let source = Source { points: &vectors, normals: &vectors, rays: &vectors, noise: scale };
        for kernel in [Kernel::Tukey, Kernel::Huber, Kernel::Cauchy] {
            let [plain, robust] = [Kernel::None, kernel].map(|kernel| {
                NormalEquations::new(&pairs, &source, &pose(), &strategies(kernel)[0])
            });
            let distance = pairs[0].plane_distance.abs();
            // The scale is that of the residuals if they exceed the noise.
            let weight = kernel.weight(distance / (MAD_TO_SIGMA * distance).max(scale));
            assert!((robust.gradient - plain.gradient * weight).norm() < 1e-9);
            assert!((robust.hessian - plain.hessian * weight).norm() < 1e-7);
            assert!((plain.rmse - distance).abs() < 1e-12);
            assert_eq!((plain.count, robust.count), (1, 1));
        }
    }
}
