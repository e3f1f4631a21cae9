//! What becomes of a scan.

use super::align::{Alignment, Prior};
use super::{Method, RegisterParams};
use crate::geometry::{Mat6, Pose, Twist};
use nalgebra::SymmetricEigen;

/// Whether a scan joins the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// It does.
    Accepted,
    /// Not yet: it will be tried again when more scans are registered.
    Deferred,
    /// It does not.
    Refused,
}

impl Status {
    /// The word used in files and messages.
    pub fn word(self) -> &'static str {
        match self {
            Status::Accepted => "accepted",
            Status::Deferred => "deferred",
            Status::Refused => "refused",
        }
    }
}

/// The outcome of registering one scan.
#[derive(Clone, Debug)]
pub struct Verdict {
    /// Whether the scan joins the model.
    pub status: Status,
    /// Why, in one sentence.
    pub reason: String,
    /// Share of the sampled points that lie on the map (within three standard deviations), 0 to 1.
    pub fitness: f64,
    /// Share of the sampled points that found a correspondence, 0 to 1.
    pub overlap: f64,
    /// Root mean square distance of the correspondences, metres.
    pub rmse: f64,
    /// Number of correspondences.
    pub correspondences: usize,
    /// Covariance of the pose, order x y z rx ry rz, sensor frame, square metres and square radians.
    pub covariance: Mat6,
    /// Unit twists along which the robot's prior, not the geometry, decided.
    pub free_directions: Vec<Twist>,
}

impl Verdict {
    /// The verdict on the scan that defines the map: there is nothing to align it to.
    pub(crate) fn first(prior_information: &Mat6) -> Verdict {
        Verdict {
            status: Status::Accepted,
            reason: "defines the map that others are aligned to".into(),
            fitness: 1.0,
            overlap: 1.0,
            rmse: 0.0,
            correspondences: 0,
            covariance: inverse(prior_information),
            free_directions: (0..6).map(|k| Twist::from_fn(|i, _| f64::from(i == k))).collect(),
        }
    }

    /// Judges an alignment of `sampled` points.
    ///
    /// `prior` is what was believed of the pose relative to the map, `expected` the residual that noise explains.
    pub(crate) fn of(
        alignment: &Alignment,
        prior: &Prior,
        sampled: usize,
        expected: f64,
        params: &RegisterParams,
    ) -> Verdict {
        let overlap = alignment.correspondences as f64 / sampled.max(1) as f64;
        let free = free_directions(&alignment.information, &prior.information);
        let fitness = overlap * (expected / alignment.rmse.max(expected)).min(1.0);
        let problem = problem(alignment, prior, fitness, expected, params);
        Verdict {
            status: if problem.is_some() { Status::Deferred } else { Status::Accepted },
            reason: problem.unwrap_or_else(|| aligned(free.len())),
            fitness,
            overlap,
            rmse: alignment.rmse,
            correspondences: alignment.correspondences,
            covariance: inverse(&(alignment.information + prior.information)),
            free_directions: free,
        }
    }

    /// The same alignment, but put aside if there is a `problem`.
    pub(crate) fn unless(self, problem: Option<String>) -> Verdict {
        match problem {
            Some(reason) => Verdict { status: Status::Deferred, reason, ..self },
            None => self,
        }
    }
}

fn aligned(free: usize) -> String {
    match free {
        0 => "aligned".into(),
        1 => "aligned; one direction is left to the robot's pose".into(),
        _ => format!("aligned; {free} directions are left to the robot's pose"),
    }
}

fn problem(
    alignment: &Alignment,
    prior: &Prior,
    fitness: f64,
    expected: f64,
    params: &RegisterParams,
) -> Option<String> {
    if alignment.correspondences < params.min_correspondences {
        return Some(format!(
            "{} correspondences, {} are needed",
            alignment.correspondences, params.min_correspondences
        ));
    }
    if params.method == Method::Thesis {
        return None;
    }
    if !alignment.converged {
        return Some(format!("did not converge in {} iterations", params.max_iterations));
    }
    if let Some(far) = correction(&alignment.pose, prior, params) {
        return Some(far);
    }
    if alignment.rmse > params.max_residual * expected {
        return Some(format!(
            "residual {:.2} mm where noise explains {:.2} mm",
            alignment.rmse * 1e3,
            expected * 1e3
        ));
    }
    (fitness < params.min_overlap).then(|| {
        format!(
            "{:.0} % of the points lie on the map, {:.0} % is needed",
            fitness * 100.0,
            params.min_overlap * 100.0
        )
    })
}

/// What is wrong with a pose that lies too far from where the prior believes it.
fn correction(pose: &Pose, prior: &Prior, params: &RegisterParams) -> Option<String> {
    (prior.off_squared(pose).sqrt() > chi(params.max_correction)).then(|| {
        let xi = prior.off(pose);
        format!(
            "correction of {:.1} mm and {:.2} degrees is beyond {} standard deviations of the robot's pose",
            xi.fixed_rows::<3>(0).norm() * 1e3,
            xi.fixed_rows::<3>(3).norm().to_degrees(),
            params.max_correction
        )
    })
}

/// The radius in six dimensions that holds the probability which `sigmas` hold in one
/// (Wilson & Hilferty 1931: chi-square by a normal deviate); 3 gives 4.5.
pub(crate) fn chi(sigmas: f64) -> f64 {
    // The two-sided bound of one dimension is reached one-sidedly at nearly the same deviate.
    let z = sigmas - 0.22;
    let n = 6.0_f64;
    (n * (1.0 - 2.0 / (9.0 * n) + z * (2.0 / (9.0 * n)).sqrt()).powi(3)).sqrt()
}

fn inverse(information: &Mat6) -> Mat6 {
    information.try_inverse().unwrap_or_else(|| Mat6::from_diagonal_element(f64::INFINITY))
}

/// Directions, in units of the prior's standard deviation, in which the geometry knows less than the prior.
fn free_directions(geometry: &Mat6, prior: &Mat6) -> Vec<Twist> {
    let scale = Twist::from_fn(|i, _| prior[(i, i)].max(f64::MIN_POSITIVE).sqrt().recip());
    let whitened = Mat6::from_fn(|r, c| geometry[(r, c)] * scale[r] * scale[c]);
    let eigen = SymmetricEigen::new(whitened);
    let mut order: Vec<usize> = (0..6).filter(|&i| eigen.eigenvalues[i] < 1.0).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let twist = |i: usize| eigen.eigenvectors.column(i).component_mul(&scale);
    order.into_iter().filter_map(|i| twist(i).try_normalize(0.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_sigma_in_six_dimensions() {
        // chi-square with 6 degrees of freedom: 99.73 % below 20.06, 95.45 % below 12.85.
        assert!((chi(3.0) - 20.06_f64.sqrt()).abs() < 0.03, "{}", chi(3.0));
        assert!((chi(2.0) - 12.85_f64.sqrt()).abs() < 0.1, "{}", chi(2.0));
    }

    #[test]
    fn a_plane_leaves_two_translations_and_one_rotation_open() {
        let mut geometry = Mat6::zeros();
        for (x, y) in [(0.1, 0.1), (-0.1, 0.1), (0.1, -0.1), (-0.1, -0.1)] {
            let j = Twist::new(0.0, 0.0, 1.0, y, -x, 0.0);
            geometry += j * j.transpose() * 1e10;
        }
        let free = free_directions(&geometry, &Mat6::from_diagonal_element(1e6));
        assert_eq!(free.len(), 3);
        for twist in free {
            assert!(twist[2].abs() + twist[3].abs() + twist[4].abs() < 1e-9, "{twist}");
        }
    }
}
