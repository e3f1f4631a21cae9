//! The verdict on one scan: whether its alignment suffices for joining the model.

use crate::geometry::{Mat6, Pose, Twist};
use crate::register::align::{Alignment, Prior};
use crate::register::params::RegisterParams;
use crate::register::strategy::Strategy;
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

    /// Whether the scan joins the model.
    pub fn is_accepted(self) -> bool {
        self == Status::Accepted
    }
}

/// The outcome of registering one scan.
#[derive(Clone, Debug)]
pub struct Verdict {
    /// Whether the scan joins the model.
    pub status: Status,
    /// Why, in one sentence.
    pub reason: String,
    /// Quality of the fit, 0 to 1: `overlap`, multiplied by the ratio of the residual that noise
    /// explains to `rmse` if `rmse` is larger.
    pub fitness: f64,
    /// Share of the sampled points that lie on the map, 0 to 1: those that found a correspondence
    /// which counts.
    pub overlap: f64,
    /// Root mean square distance of the correspondences, metres.
    pub rmse: f64,
    /// Number of correspondences.
    pub correspondences: usize,
    /// Covariance of the pose, order x y z rx ry rz, sensor frame, square metres and square
    /// radians.
    pub covariance: Mat6,
    /// Unit twists along which the robot's prior, not the geometry, decided; order x y z rx ry rz.
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
            covariance: covariance(prior_information),
            free_directions: (0..6).map(|k| Twist::from_fn(|i, _| f64::from(i == k))).collect(),
        }
    }

    /// The verdict on a scan that was not aligned yet.
    pub(crate) fn deferred(prior_information: &Mat6) -> Verdict {
        Verdict { status: Status::Deferred, ..Verdict::first(prior_information) }
    }

    /// Whether the scan joins the model.
    pub fn is_accepted(&self) -> bool {
        self.status.is_accepted()
    }

    /// Judges an alignment of `sampled` points: accepted, or deferred with the reason.
    ///
    /// `prior` is what was known of the pose relative to the map, `expected_rmse` (metres) the
    /// residual that noise explains.
    pub(crate) fn from_alignment(
        alignment: &Alignment,
        prior: &Prior,
        sampled: usize,
        expected_rmse: f64,
        strategy: &Strategy,
    ) -> Verdict {
        let overlap = alignment.correspondences as f64 / sampled.max(1) as f64;
        let free_directions = free_directions(&alignment.information, &prior.information);
        let problem = if strategy.examines_alignments {
            count_problem(alignment, &strategy.params).or_else(|| {
                alignment_problem(alignment, prior, overlap, expected_rmse, &strategy.params)
            })
        } else {
            count_problem(alignment, &strategy.params)
        };
        Verdict {
            status: if problem.is_some() { Status::Deferred } else { Status::Accepted },
            reason: problem.unwrap_or_else(|| success_reason(free_directions.len())),
            fitness: overlap * (expected_rmse / alignment.rmse.max(expected_rmse)).min(1.0),
            overlap,
            rmse: alignment.rmse,
            correspondences: alignment.correspondences,
            covariance: covariance(&(alignment.information + prior.information)),
            free_directions,
        }
    }

    /// The same alignment, but deferred if there is a `problem`.
    pub(crate) fn unless(self, problem: Option<String>) -> Verdict {
        match problem {
            Some(reason) => Verdict { status: Status::Deferred, reason, ..self },
            None => self,
        }
    }
}

fn success_reason(free_directions: usize) -> String {
    match free_directions {
        0 => "aligned".into(),
        1 => "aligned; one direction is left to the robot's pose".into(),
        _ => format!("aligned; {free_directions} directions are left to the robot's pose"),
    }
}

/// Too few correspondences.
fn count_problem(alignment: &Alignment, params: &RegisterParams) -> Option<String> {
    (alignment.correspondences < params.min_correspondences).then(|| {
        format!(
            "{} correspondences, {} are needed",
            alignment.correspondences, params.min_correspondences
        )
    })
}

/// What else is wrong with an alignment.
fn alignment_problem(
    alignment: &Alignment,
    prior: &Prior,
    overlap: f64,
    expected_rmse: f64,
    params: &RegisterParams,
) -> Option<String> {
    if !alignment.converged {
        return Some(format!("did not converge in {} iterations", params.max_iterations));
    }
    if let Some(problem) = correction_problem(&alignment.pose, prior, params) {
        return Some(problem);
    }
    if alignment.rmse > params.max_residual * expected_rmse {
        return Some(format!(
            "residual {:.2} mm where noise explains {:.2} mm",
            alignment.rmse * 1e3,
            expected_rmse * 1e3
        ));
    }
    (overlap < params.min_overlap).then(|| {
        format!(
            "{:.0} % of the points lie on the map, {:.0} % is needed",
            overlap * 100.0,
            params.min_overlap * 100.0
        )
    })
}

/// A pose that lies too far from the expected one.
fn correction_problem(pose: &Pose, prior: &Prior, params: &RegisterParams) -> Option<String> {
    (prior.mahalanobis_squared(pose).sqrt() > mahalanobis_bound(params.max_correction)).then(|| {
        let xi = prior.correction(pose);
        format!(
            "correction of {:.1} mm and {:.2} degrees is beyond {} standard deviations of the robot's pose",
            xi.fixed_rows::<3>(0).norm() * 1e3,
            xi.fixed_rows::<3>(3).norm().to_degrees(),
            params.max_correction
        )
    })
}

/// Difference of the standard normal deviates at which a two-sided and a one-sided bound hold the
/// same probability, near three standard deviations (3 and 2.78).
const ONE_SIDED_SHIFT: f64 = 0.22;

/// The Mahalanobis distance of a pose, in six dimensions, that holds the probability which `sigmas`
/// standard deviations hold in one (chi-square by a normal deviate; Wilson & Hilferty 1931, The
/// Distribution of Chi-square); 3 gives 4.5.
pub(super) fn mahalanobis_bound(sigmas: f64) -> f64 {
    let z = sigmas - ONE_SIDED_SHIFT;
    let n = 6.0_f64; // dimensions
    // Wilson & Hilferty: (chi^2 / n)^(1/3) is normal with mean 1 - 2 / (9 n) and variance 2 / (9
    // n).
    (n * (1.0 - 2.0 / (9.0 * n) + z * (2.0 / (9.0 * n)).sqrt()).powi(3)).sqrt()
}

/// The inverse of an information; infinite if it has none.
fn covariance(information: &Mat6) -> Mat6 {
    information.try_inverse().unwrap_or_else(|| Mat6::from_diagonal_element(f64::INFINITY))
}

/// Unit twists along which the geometry has less information than the prior, the least first;
/// directions are compared in units of the prior's standard deviations.
fn free_directions(geometry: &Mat6, prior: &Mat6) -> Vec<Twist> {
    let sigma = Twist::from_fn(|i, _| prior[(i, i)].max(f64::MIN_POSITIVE).sqrt().recip());
    let relative = Mat6::from_fn(|r, c| geometry[(r, c)] * sigma[r] * sigma[c]);
    let eigen = SymmetricEigen::new(relative);
    let mut order: Vec<usize> = (0..6).filter(|&i| eigen.eigenvalues[i] < 1.0).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    order
        .into_iter()
        .filter_map(|i| eigen.eigenvectors.column(i).component_mul(&sigma).try_normalize(0.0))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::exp;
    use crate::register::params::RegistrationMethod;

    const EXPECTED_RMSE: f64 = 1e-4;

    fn prior() -> Prior {
        // 1 mm and 1 mrad.
        Prior { pose: Pose::identity(), information: Mat6::from_diagonal_element(1e6) }
    }

    fn alignment(correspondences: usize, rmse: f64) -> Alignment {
        Alignment {
            pose: Pose::identity(),
            correspondences,
            rmse,
            converged: true,
            information: Mat6::from_diagonal_element(1e8),
        }
    }

    /// The verdict on an alignment of 2,000 points by the default parameters.
    fn judged(alignment: &Alignment) -> Verdict {
        let strategy = Strategy::new(&RegisterParams::default());
        Verdict::from_alignment(alignment, &prior(), 2000, EXPECTED_RMSE, &strategy)
    }

    #[test]
    fn the_overlap_that_is_needed_is_a_share_of_points_whatever_the_residual() {
        // 15 % of the points lie on the map and 10 % are needed. The residual is twice what noise
        // explains, which is allowed, and makes the fitness 7.5 %.
        let verdict = judged(&alignment(300, 2.0 * EXPECTED_RMSE));
        assert!((verdict.overlap - 0.15).abs() < 1e-12);
        assert!((verdict.fitness - 0.075).abs() < 1e-12);
        assert!(verdict.is_accepted(), "{}", verdict.reason);

        let verdict = judged(&alignment(180, EXPECTED_RMSE));
        assert_eq!(verdict.status, Status::Deferred);
        assert_eq!(verdict.reason, "9 % of the points lie on the map, 10 % is needed");
    }

    #[test]
    fn each_problem_defers_with_its_reason() {
        let good = alignment(1000, EXPECTED_RMSE);
        assert!(judged(&good).is_accepted());
        let far = exp(&Twist::new(5e-3, 0.0, 0.0, 0.0, 0.0, 0.0));
        let cases = [
            (alignment(99, EXPECTED_RMSE), "99 correspondences, 100 are needed"),
            (Alignment { converged: false, ..good.clone() }, "did not converge in 60 iterations"),
            (Alignment { pose: far, ..good }, "correction of 5.0 mm and 0.00 degrees is beyond 3"),
            (alignment(1000, 2.3 * EXPECTED_RMSE), "residual 0.23 mm where noise explains 0.10 mm"),
        ];
        for (alignment, reason) in cases {
            let verdict = judged(&alignment);
            assert_eq!(verdict.status, Status::Deferred);
            assert!(verdict.reason.starts_with(reason), "{}", verdict.reason);
        }
    }

    #[test]
    fn the_thesis_asks_for_correspondences_alone() {
        let params =
            RegisterParams { method: RegistrationMethod::Thesis, ..RegisterParams::default() };
        let strategy = Strategy::new(&params);
        let poor = Alignment { converged: false, ..alignment(100, 1.0) };
        assert!(Verdict::from_alignment(&poor, &prior(), 2000, 1e-4, &strategy).is_accepted());
        let few = alignment(99, 0.0);
        assert!(!Verdict::from_alignment(&few, &prior(), 2000, 1e-4, &strategy).is_accepted());
    }

    #[test]
    fn the_covariance_is_that_of_geometry_and_prior_together() {
        let verdict = judged(&alignment(1000, EXPECTED_RMSE));
        assert!((verdict.covariance - Mat6::from_diagonal_element(1.0 / 1.01e8)).amax() < 1e-20);
    }

    #[test]
    fn three_sigma_in_six_dimensions() {
        // chi-square with 6 degrees of freedom: 99.73 % below 20.06, 95.45 % below 12.85.
        let [three, two] = [3.0, 2.0].map(mahalanobis_bound);
        assert!((three - 20.06_f64.sqrt()).abs() < 0.03, "{three}");
        assert!((two - 12.85_f64.sqrt()).abs() < 0.1, "{two}");
    }

    #[test]
    fn a_plane_leaves_two_translations_and_one_rotation_free() {
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
