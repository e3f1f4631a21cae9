//! Stage 6: minimising the error by Gauss-Newton steps, with new pairs in each iteration.

use super::icp_iteration::IcpIteration;
use super::map::Map;
use super::metric::NormalEquations;
use super::prior::Prior;
use super::source::Source;
use crate::geometry::{Mat6, Pose, Twist, exp};
use crate::register::strategy::Strategy;
use nalgebra::SymmetricEigen;

/// The schedule of the search radius, metres.
#[derive(Clone, Copy)]
pub(crate) struct SearchRadius {
    /// In the first iteration.
    pub start: f64,
    /// Once it has shrunk.
    pub end: f64,
}

/// The outcome of one alignment.
#[derive(Clone, Debug)]
pub(crate) struct Alignment {
    /// Where the scan is, `map_from_sensor`.
    pub pose: Pose,
    /// Number of pairs that count.
    pub correspondences: usize,
    /// Root mean square residual, metres.
    pub rmse: f64,
    /// Whether the last step was small and the search radius at its end.
    pub converged: bool,
    /// Information that the correspondences alone give.
    pub information: Mat6,
}

/// The radius shrinks to its end by this factor an iteration: slow enough to follow the alignment.
const RADIUS_SHRINK_RATIO: f64 = 0.75;
/// Points of the subsample that is aligned first. For one pose with six unknowns, more do not lead
/// to another minimum.
const COARSE_POINTS: usize = 500;
/// A step below this many standard deviations of the pose ends the iteration.
const MIN_STEP_SIGMAS: f64 = 0.1;
/// A direction with less than this share of the best direction's information has none: it is
/// rounding.
const MIN_INFORMATION_RATIO: f64 = 1e-12;

/// Aligns `source` to the map, from the pose of the prior: coarse to fine, a subsample first, then
/// all points.
pub(crate) fn align(
    source: &Source,
    map: &Map,
    prior: &Prior,
    radius: SearchRadius,
    strategy: &Strategy,
) -> Alignment {
    let stride = source.points.len() / COARSE_POINTS;
    if stride < 2 || !strategy.aligns_subsample_first {
        return gauss_newton(source, map, prior, &prior.pose, radius, strategy);
    }
    let subset = source.every(stride);
    let coarse =
        gauss_newton(&subset.source(source.noise), map, prior, &prior.pose, radius, strategy);
    let fine_radius = SearchRadius { start: radius.end, end: radius.end };
    gauss_newton(source, map, prior, &coarse.pose, fine_radius, strategy)
}

/// Iterates from `start` until the prior and the pairs within the shrinking radius agree.
fn gauss_newton(
    source: &Source,
    map: &Map,
    prior: &Prior,
    start: &Pose,
    radius: SearchRadius,
    strategy: &Strategy,
) -> Alignment {
    let mut iteration = IcpIteration::new(*source, map, strategy);
    let mut pose = *start;
    let mut reach = radius.start;
    let mut converged = false;
    let mut system = iteration.next(&pose, reach);
    for _ in 0..strategy.params.max_iterations {
        let (mut hessian, mut gradient) = (system.hessian, system.gradient);
        if strategy.uses_prior {
            // The derivative of log(T0^-1 T exp(xi)) by xi is the identity to first order in the
            // correction.
            hessian += prior.information;
            gradient += prior.information * prior.correction(&pose);
        }
        let Some(step) = solve(&hessian, &gradient) else { break };
        pose *= exp(&step);
        let is_small = step.dot(&(hessian * step)) < MIN_STEP_SIGMAS * MIN_STEP_SIGMAS;
        let at_end = reach <= radius.end && iteration.takes_all();
        reach = (reach * RADIUS_SHRINK_RATIO).max(radius.end);
        system = iteration.next(&pose, reach);
        if is_small && at_end {
            converged = true;
            break;
        }
    }
    let NormalEquations { hessian, rmse, count, .. } = system;
    Alignment { pose, correspondences: count, rmse, converged, information: hessian }
}

/// The step `-hessian^-1 gradient`, which moves nothing along directions without information; none
/// if there is no information at all.
fn solve(hessian: &Mat6, gradient: &Twist) -> Option<Twist> {
    let eigen = SymmetricEigen::new(*hessian);
    let largest = eigen.eigenvalues.max();
    if !(largest.is_finite() && largest > 0.0) {
        return None;
    }
    let mut step = Twist::zeros();
    for (i, &value) in eigen.eigenvalues.iter().enumerate() {
        if value > MIN_INFORMATION_RATIO * largest {
            let direction = eigen.eigenvectors.column(i);
            step -= direction * (direction.dot(gradient) / value);
        }
    }
    Some(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_solves_the_equations_and_leaves_free_directions_alone() {
        let jacobian = Twist::new(1.0, 2.0, -0.5, 0.3, 0.0, 1.0);
        let full = Mat6::from_diagonal_element(2.0) + jacobian * jacobian.transpose();
        let gradient = Twist::new(0.1, -0.2, 0.3, -0.4, 0.5, -0.6);
        let step = solve(&full, &gradient).unwrap();
        assert!((full * step + gradient).norm() < 1e-12);

        let mut flat = Mat6::from_diagonal_element(2.0);
        flat[(1, 1)] = 0.0;
        let step = solve(&flat, &gradient).unwrap();
        assert_eq!(step[1], 0.0);
        assert!((step[0] + 0.05).abs() < 1e-12);
        assert!(solve(&Mat6::zeros(), &gradient).is_none());
    }
}
