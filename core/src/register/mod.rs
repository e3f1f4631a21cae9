//! Registration of scans (Wiedemann 2014, §2.3.1).
//!
//! Two stages, as in the thesis: each scan is aligned to the scans registered before it, the one that overlaps
//! most with them first; those put aside are
//! tried again until none is left or nothing changes. By default the alignment is point-to-plane with the
//! robot's pose as prior (maximum a posteriori), so that directions which the geometry leaves open stay where
//! the robot says, and a joint optimisation over all accepted scans spreads the remaining error.

mod align;
mod correlation;
mod equations;
mod evidence;
mod factors;
mod joint;
mod layers;
mod normals;
mod pair;
mod place;
mod prepare;
mod registrar;
mod revise;
mod rivals;
mod sample;
mod sigma;
mod stages;
mod surfels;
mod trust;
mod variants;
mod verdict;
mod whiten;

pub use align::{Kernel, Matching, Rejection, Selection, Weight};
pub use pair::{PairScan, align_pair, align_pair_within};
pub use prepare::{PreparedScan, Unoriented};
pub use registrar::Registrar;
pub use variants::{Variant, variants};
pub use verdict::{Status, Verdict};

use crate::geometry::Pose;
use crate::scans::PoseSigma;
use crate::{Error, Progress, Result};
use joint::Start;
use revise::revise;
use sample::Sample;

crate::choice! {
    /// How scans are aligned.
    pub enum Method {
        /// The distance along the normal halfway between the two points' (Chen & Medioni 1992; Rusinkiewicz 2019), with
        /// the robot's pose as prior.
        PointToPlane = "point_to_plane",
        /// The distance between the two points (Besl & McKay 1992), with the robot's pose as prior.
        PointToPoint = "point_to_point",
        /// Generalized ICP (Segal, Haehnel & Thrun 2009): both points are uncertain within their planes; with the robot's
        /// pose as prior.
        PlaneToPlane = "plane_to_plane",
        /// The thesis's: point-to-point within a fixed radius, normals compared, no prior.
        Thesis = "thesis",
    }
}

crate::params! {
    /// Parameters of the registration.
    pub struct RegisterParams("register") {
        /// How scans are aligned; `thesis` has its own choices for the stages of ICP that follow.
        method: Method = Method::PointToPlane;
        /// Stage 1 of ICP: which points of a scan are aligned.
        selection: Selection = Selection::Uniform;
        /// Stage 2: which point of the map a point of the scan should lie on.
        matching: Matching = Matching::Closest;
        /// Stage 3: what a pair of points counts for.
        weight: Weight = Weight::Constant;
        /// Robust kernel: what large residuals count for beside small ones.
        kernel: Kernel = Kernel::Tukey;
        /// Stage 4: which pairs within the search radius are rejected.
        rejection: Rejection = Rejection::Normals;
        /// Share of the pairs that `rejection: trimmed` rejects.
        trim: f64 = 0.1, in [0.0, 0.9];
        /// Seed of the selections that draw by chance.
        seed: usize = 1, in [0, 1000000];
        /// Search radius for correspondences at the start; 0 takes it from the pose's standard deviation.
        radius: f64 = 0.0, in [0.0, 1.0], unit "m";
        /// Pairs whose normals differ by more are rejected.
        max_normal_angle: f64 = 0.785, in [0.0, 3.15], unit "rad";
        /// A scan with fewer correspondences is put aside.
        min_correspondences: usize = 100, in [6, 1000000];
        /// A scan of which a smaller share lies on the map is put aside.
        min_overlap: f64 = 0.1, in [0.0, 1.0];
        /// Points sampled from each scan.
        samples: usize = 2000, in [50, 1000000];
        /// Iterations of one alignment at most.
        max_iterations: usize = 60, in [1, 1000];
        /// Times that a scan put aside is tried at most.
        max_rounds: usize = 5, in [1, 100];
        /// What a correspondence counts for beside the prior while the scans are being brought together; below 1 because
        /// neighbours share their noise. At the end what they share is estimated from the residuals and taken out.
        information_share: f64 = 0.05, in [0.0001, 1.0];
        /// Corrections beyond this many standard deviations of the prior are deferred, then refused.
        max_correction: f64 = 3.0, in [0.5, 100.0];
        /// Residuals larger than what noise explains by this factor are of surfaces that do not belong together.
        max_residual: f64 = 2.2, in [1.0, 100.0];
        /// Whether all accepted scans are optimised together at the end.
        joint: bool = true;
        /// Passes of the joint optimisation at most, each with new correspondences.
        joint_iterations: usize = 12, in [1, 1000];
    }
}

/// The registered scans: one entry a view in each list.
#[derive(Clone, Debug)]
pub struct Registration {
    /// Estimated `object_from_sensor`.
    pub poses: Vec<Pose>,
    /// What became of each scan.
    pub verdicts: Vec<Verdict>,
    /// Standard deviation of the given poses that was used.
    pub pose_sigma: PoseSigma,
    /// Root mean square point-to-plane distance between overlapping scans, metres; NaN with one scan.
    pub residual: f64,
}

impl Registration {
    /// The registration of scans whose poses `object_from_sensor` are known exactly.
    pub fn exact(scans: &[PreparedScan], poses: &[Pose]) -> Registration {
        let pose_sigma = PoseSigma { translation: 0.0, rotation: 0.0 };
        let verdict = Verdict {
            reason: "pose given as exact".into(),
            ..Verdict::first(&pose_sigma.information())
        };
        let verdicts = vec![Verdict { free_directions: Vec::new(), ..verdict }; poses.len()];
        let mut registration =
            Registration { poses: poses.to_vec(), verdicts, pose_sigma, residual: f64::NAN };
        let params = RegisterParams::default();
        let samples: Vec<Sample> =
            scans.iter().map(|scan| Sample::new(scan, pose_sigma, &params)).collect();
        registration.residual = joint::residual(&samples, &registration, &params);
        registration
    }
}

/// Registers `scans` (sensor frame), starting from the robot's poses `object_from_sensor`.
///
/// `pose_sigma` is the robot's; without one it is estimated from how far the scans lie apart.
///
/// # Errors
/// [`Error::Input`] if there is no scan, or not a pose for each; [`Error::Cancelled`].
pub fn register(
    scans: &[PreparedScan],
    robot: &[Pose],
    pose_sigma: Option<PoseSigma>,
    params: &RegisterParams,
    progress: &Progress,
) -> Result<Registration> {
    if scans.is_empty() || scans.len() != robot.len() {
        return Err(Error::input(format!(
            "{} scans with {} poses: each scan needs one pose",
            scans.len(),
            robot.len()
        )));
    }
    let samples = |sigma: PoseSigma| -> Vec<Sample> {
        scans.iter().map(|scan| Sample::new(scan, sigma, params)).collect()
    };
    let pose_sigma = pose_sigma.unwrap_or_else(|| {
        sigma::estimate(&samples(PoseSigma { translation: 0.0, rotation: 0.0 }), robot)
    });
    register_samples(&samples(pose_sigma), robot, pose_sigma, params, progress)
}

fn register_samples(
    samples: &[Sample],
    robot: &[Pose],
    pose_sigma: PoseSigma,
    params: &RegisterParams,
    progress: &Progress,
) -> Result<Registration> {
    let mut registration = stages::two_stages(samples, robot, pose_sigma, params, progress)?;
    if params.joint && params.method != Method::Thesis {
        joint::optimise(samples, robot, &mut registration, Start::Coarse, params, progress)?;
        // The first scans' errors had moved the map away from the priors. It stands right now: what was refused
        // for that reason has another chance, and what came to rest wrongly.
        let mut joined = stages::place_rest(samples, robot, &mut registration, params, progress)?;
        joined += stages::tie(samples, robot, &mut registration, params, progress)?;
        if revise(samples, robot, &mut registration, params) + joined > 0 {
            joint::optimise(samples, robot, &mut registration, Start::Fine, params, progress)?;
        }
    }
    registration.residual = joint::residual(samples, &registration, params);
    Ok(registration)
}

#[cfg(test)]
mod breathing_tests;
#[cfg(test)]
mod sharp_shapes_tests;
#[cfg(test)]
mod symmetric_tests;
#[cfg(test)]
mod tests;
