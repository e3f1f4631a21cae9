//! Gauss-Newton steps over the poses of all accepted scans, coarse to fine, perturbed on the right
//! (Barfoot 2017, State Estimation for Robotics, §7.1.9).

use super::measurements::SurfaceMeasurements;
use super::resolution::Resolution;
use crate::geometry::{Mat6, Pose, Twist, exp, log};
use crate::register::params::RegisterParams;
use crate::register::registration::Registration;
use crate::register::registration_scan::RegistrationScan;
use crate::{Error, Progress, Result};
use nalgebra::{DMatrix, DVector};

/// The search ends with a step below this many standard deviations of each pose: surfels that are
/// laid anew move poses by a third of a standard deviation.
const MAX_FINAL_STEP_SIGMA: f64 = 0.5;
/// Steps at the finest resolution are longer by this factor (over-relaxation, which converges below
/// a factor of 2).
const RELAXATION_FACTOR: f64 = 1.7;
/// Where poses still have the errors of the scan-by-scan alignment, the first resolution is coarser
/// than the finest one by this factor.
const COARSE_START_RATIO: f64 = 4.0;

/// How far from the optimum the poses may still be.
#[derive(Clone, Copy)]
pub(crate) enum Start {
    /// By the errors that scans had when they were aligned one by one.
    Coarse,
    /// Only a few scans have moved since the last joint optimisation.
    Fine,
}

/// Moves the poses of all accepted scans to their joint optimum and sets the covariances of their
/// verdicts. `robot` holds the prior mean of every scan's pose.
///
/// # Errors
/// [`Error::Input`] if the normal equations are singular; [`Error::Cancelled`].
pub(crate) fn optimise(
    scans: &[&RegistrationScan],
    robot: &[Pose],
    registration: &mut Registration,
    start: Start,
    params: &RegisterParams,
    progress: &Progress,
) -> Result<()> {
    let accepted = registration.accepted();
    if accepted.len() < 2 {
        return Ok(());
    }
    let problem = JointProblem {
        scans: accepted.iter().map(|&i| scans[i]).collect(),
        prior_means: accepted.iter().map(|&i| robot[i]).collect(),
        prior_information: registration.pose_sigma.information(),
        params,
    };
    let mut poses: Vec<Pose> = accepted.iter().map(|&i| registration.poses[i]).collect();
    let information = problem.solve(&mut poses, start, progress)?;
    let covariance = information.cholesky().map(|c| c.inverse());
    for (k, &i) in accepted.iter().enumerate() {
        registration.poses[i] = poses[k];
        if let Some(covariance) = &covariance {
            registration.verdicts[i].covariance =
                covariance.fixed_view::<6, 6>(6 * k, 6 * k).into_owned();
        }
    }
    Ok(())
}

/// The accepted scans and what is believed of their poses.
struct JointProblem<'a> {
    scans: Vec<&'a RegistrationScan>,
    /// The robot's poses.
    prior_means: Vec<Pose>,
    /// Information of each pose on its prior mean.
    prior_information: Mat6,
    params: &'a RegisterParams,
}

/// The problem linearised at some poses; six rows a scan.
struct Linearisation {
    /// Information of the measurements and of the priors: the inverse of the poses' covariance.
    information: DMatrix<f64>,
    /// How much the gradient changes with the poses; steps are solved with it.
    stiffness: DMatrix<f64>,
    gradient: DVector<f64>,
}

impl JointProblem<'_> {
    /// Moves `poses` to the optimum. Returns the information there.
    fn solve(&self, poses: &mut [Pose], start: Start, progress: &Progress) -> Result<DMatrix<f64>> {
        let finest = Resolution::finest(&self.scans);
        let mut resolution = match start {
            Start::Coarse => finest.coarser(COARSE_START_RATIO),
            Start::Fine => finest,
        };
        let iterations = self.params.joint_iterations;
        let mut information = DMatrix::zeros(0, 0);
        let mut late_poses: Vec<Vec<Pose>> = Vec::new();
        for iteration in 0..iterations {
            progress.report("optimise", iteration as f64 / iterations as f64)?;
            let is_finest = resolution.reach <= finest.reach;
            let linear = if is_finest {
                self.linearise_finest(poses, resolution, iteration + 1 == iterations)?
            } else {
                self.linearise_coarse(poses, resolution)?
            };
            let step_sigma = take_step(poses, &linear)?;
            information = linear.information;
            if is_finest && step_sigma < MAX_FINAL_STEP_SIGMA {
                return Ok(information);
            }
            if is_finest && 2 * iteration >= iterations {
                late_poses.push(poses.to_vec());
            }
            resolution = resolution.refined(&finest);
        }
        move_to_mean(poses, &late_poses);
        Ok(information)
    }

    /// The problem at a coarse resolution, where errors are larger than noise: neighbours' common
    /// noise is accounted for by `information_share` alone.
    fn linearise_coarse(&self, poses: &[Pose], resolution: Resolution) -> Result<Linearisation> {
        let measurements = SurfaceMeasurements::new(&self.scans, poses, resolution, self.params);
        let (hessian, gradient) = measurements.normal_equations()?;
        Ok(self.with_priors(
            Linearisation { information: hessian.clone(), stiffness: hessian, gradient },
            poses,
        ))
    }

    /// The problem at the finest resolution, where noise decides: whitened, and shrunk to what the
    /// surface determines.
    fn linearise_finest(
        &self,
        poses: &[Pose],
        resolution: Resolution,
        is_last: bool,
    ) -> Result<Linearisation> {
        let mut measurements =
            SurfaceMeasurements::new(&self.scans, poses, resolution, self.params);
        measurements.estimate_correlation();
        let (hessian, gradient) = measurements.normal_equations()?;
        let shrinkage =
            measurements.shrinkage(poses, &self.prior_information).ok_or_else(singular)?;
        let mut linear = Linearisation {
            gradient: shrinkage.gradient(&gradient),
            stiffness: shrinkage.stiffness(&hessian),
            information: shrinkage.information(&hessian),
        };
        // The surfels of the next iteration follow the scans that they are made of, so that a full
        // step goes only part of the way. The priors do not follow.
        if !is_last {
            linear.stiffness /= RELAXATION_FACTOR;
        }
        Ok(self.with_priors(linear, poses))
    }

    /// Adds the priors to what the measurements say.
    fn with_priors(&self, mut linear: Linearisation, poses: &[Pose]) -> Linearisation {
        for (k, (pose, prior_mean)) in poses.iter().zip(&self.prior_means).enumerate() {
            let mut block = linear.information.fixed_view_mut::<6, 6>(6 * k, 6 * k);
            block += self.prior_information;
            let mut block = linear.stiffness.fixed_view_mut::<6, 6>(6 * k, 6 * k);
            block += self.prior_information;
            let mut rows = linear.gradient.fixed_rows_mut::<6>(6 * k);
            rows += self.prior_information * log(&(prior_mean.inverse() * pose));
        }
        linear
    }
}

/// Moves `poses` by one Newton step. Returns the largest step of a pose, in its standard
/// deviations.
fn take_step(poses: &mut [Pose], linear: &Linearisation) -> Result<f64> {
    let solver = linear.stiffness.clone().cholesky().ok_or_else(singular)?;
    let step = solver.solve(&-&linear.gradient);
    let mut largest = 0.0_f64;
    for (k, pose) in poses.iter_mut().enumerate() {
        let xi: Twist = step.fixed_rows::<6>(6 * k).into_owned();
        let block: Mat6 = linear.information.fixed_view::<6, 6>(6 * k, 6 * k).into_owned();
        largest = largest.max(xi.dot(&(block * xi)).sqrt());
        *pose *= exp(&xi);
    }
    Ok(largest)
}

/// Moves `poses` to the mean of the poses of `late_iterations`, if there are any. Because surfels
/// are laid anew in each iteration, the steps are noisy: where the geometry determines little,
/// poses wander about their optimum, and their mean is nearer to it (Polyak & Juditsky 1992,
/// Acceleration of Stochastic Approximation by Averaging).
fn move_to_mean(poses: &mut [Pose], late_iterations: &[Vec<Pose>]) {
    if late_iterations.is_empty() {
        return;
    }
    for (k, pose) in poses.iter_mut().enumerate() {
        let sum: Twist =
            late_iterations.iter().map(|iteration| log(&(pose.inverse() * iteration[k]))).sum();
        *pose *= exp(&(sum / late_iterations.len() as f64));
    }
}

fn singular() -> Error {
    Error::input("the joint registration is singular: is a pose sigma infinite?")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A problem of two scans without any measurement.
    fn priors_alone(params: &RegisterParams) -> JointProblem<'_> {
        let information = Mat6::from_diagonal(&Twist::new(4.0, 1.0, 2.0, 9.0, 5.0, 1.0));
        let coupling = Twist::new(0.5, -0.2, 0.1, 0.3, 0.0, 0.4);
        JointProblem {
            scans: Vec::new(),
            prior_means: vec![
                exp(&Twist::new(0.1, -0.2, 0.3, 0.4, 0.5, -0.6)),
                exp(&Twist::new(-0.3, 0.1, 0.0, 1.0, -0.5, 0.2)),
            ],
            prior_information: information + coupling * coupling.transpose(),
            params,
        }
    }

    fn without_measurements(scans: usize) -> Linearisation {
        let zeros = DMatrix::zeros(6 * scans, 6 * scans);
        let gradient = DVector::zeros(6 * scans);
        Linearisation { information: zeros.clone(), stiffness: zeros, gradient }
    }

    #[test]
    fn the_gradient_of_the_priors_agrees_with_finite_differences() {
        const STEP: f64 = 1e-6;
        let params = RegisterParams::default();
        let problem = priors_alone(&params);
        let offset = Twist::new(1e-3, -2e-3, 1e-3, 3e-3, 1e-3, -2e-3);
        let poses: Vec<Pose> = problem.prior_means.iter().map(|mean| mean * exp(&offset)).collect();
        let linear = problem.with_priors(without_measurements(2), &poses);
        for (k, (pose, mean)) in poses.iter().zip(&problem.prior_means).enumerate() {
            for i in 0..6 {
                let [up, down] = [STEP, -STEP].map(|step| {
                    let moved = pose * exp(&Twist::from_fn(|j, _| if i == j { step } else { 0.0 }));
                    let correction = log(&(mean.inverse() * moved));
                    0.5 * correction.dot(&(problem.prior_information * correction))
                });
                // The derivative of the logarithm is the identity to first order in the correction.
                let expected = (up - down) / (2.0 * STEP);
                assert!(
                    (linear.gradient[6 * k + i] - expected).abs() < 1e-4,
                    "{k} {i}: {expected}"
                );
            }
        }
    }

    #[test]
    fn one_step_leads_to_the_priors_where_nothing_is_measured() {
        let params = RegisterParams::default();
        let problem = priors_alone(&params);
        let offset = Twist::new(0.0, 0.3, 0.0, 0.0, 0.2, 0.0);
        let mut poses = problem.prior_means.clone();
        poses[1] *= exp(&offset);
        let linear = problem.with_priors(without_measurements(2), &poses);
        let step_sigma = take_step(&mut poses, &linear).unwrap();
        let expected = offset.dot(&(problem.prior_information * offset)).sqrt();
        assert!((step_sigma - expected).abs() < 1e-12, "{step_sigma}");
        for (pose, mean) in poses.iter().zip(&problem.prior_means) {
            assert!(log(&(mean.inverse() * pose)).norm() < 1e-12);
        }
    }

    #[test]
    fn an_infinite_sigma_without_measurements_is_an_error() {
        let mut poses = vec![Pose::identity()];
        let error = take_step(&mut poses, &without_measurements(1)).unwrap_err();
        assert!(error.to_string().contains("singular"), "{error}");
    }

    #[test]
    fn poses_that_wander_end_at_their_mean() {
        let middle = exp(&Twist::new(0.1, -0.2, 0.3, 0.4, 0.5, -0.6));
        let away = Twist::new(1e-3, 2e-3, -1e-3, 2e-3, 1e-3, 3e-3);
        let steps = [-2.0, 1.0, -1.0, 2.0];
        let passed: Vec<Vec<Pose>> =
            steps.iter().map(|step| vec![middle * exp(&(away * *step))]).collect();
        let mut poses = passed[3].clone();
        move_to_mean(&mut poses, &passed);
        assert!(log(&(middle.inverse() * poses[0])).norm() < 1e-5);
        move_to_mean(&mut poses, &[]);
        assert!(log(&(middle.inverse() * poses[0])).norm() < 1e-5);
    }
}
