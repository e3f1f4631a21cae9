//! Registration of scans (Wiedemann 2014, §2.3.1).
//!
//! Two stages, as in the thesis: each scan is aligned to the scans registered before it, the one
//! that overlaps most with them first; deferred ones are tried again until none is left or nothing
//! changes. By default the alignment is point-to-plane with the robot's pose as prior (maximum a
//! posteriori), so that directions which the geometry leaves open stay where the robot says, and a
//! joint optimisation over all accepted scans spreads the remaining error.
//!
//! [`register`] takes all scans at once, [`Registrar`] one after another, [`align_pair`] two.
//!
//! ```
//! use puffer_core::Progress;
//! use puffer_core::geometry::{Pose, Scan};
//! use puffer_core::register::{RegisterParams, register};
//! use puffer_core::scan::{PoseSigma, PreparedScan};
//!
//! // A wavy surface of 60 x 60 mm, 0.3 m before the sensor.
//! let points = (0..3600)
//!     .map(|i| {
//!         let (x, y) = ((i % 60) as f32 * 1e-3 - 0.03, (i / 60) as f32 * 1e-3 - 0.03);
//!         [x, y, 0.3 + 5e-3 * (150.0 * x).sin() * (120.0 * y).cos()]
//!     })
//!     .collect();
//! let scan = Scan { points, width: 60, origins: Vec::new() };
//! let prepared = PreparedScan::new(&scan)?;
//! // Two scans of it from one place, of which the robot says that they are 2 mm apart.
//! let robot = [Pose::identity(), Pose::translation(2e-3, 0.0, 0.0)];
//! let sigma = PoseSigma { translation: 3e-3, rotation: 0.01 };
//! let scans = [prepared.clone(), prepared];
//! let params = RegisterParams::default();
//! let result = register(&scans, &robot, Some(sigma), &params, &Progress::silent())?;
//! assert!(result.verdicts.iter().all(|verdict| verdict.is_accepted()));
//! let apart = result.poses[0].inverse() * result.poses[1];
//! assert!(apart.translation.vector.norm() < 2e-4);
//! # Ok::<(), puffer_core::Error>(())
//! ```

mod align;
mod icp_variants;
mod joint;
mod judge;
mod pair;
mod params;
mod pose_sigma_estimate;
mod registrar;
mod registration;
mod registration_problem;
mod registration_scan;
mod scan_registration;
mod strategy;

pub use icp_variants::{IcpVariant, icp_variants};
pub use judge::{Status, Verdict};
pub use pair::{PairScan, align_pair, align_pair_with_covariance};
pub use params::{
    Kernel, Matching, RegisterParams, RegistrationMethod, Rejection, Selection, Weight,
};
pub use registrar::Registrar;
pub use registration::Registration;

use crate::geometry::Pose;
use crate::scan::{PoseSigma, PreparedScan};
use crate::{Error, Progress, Result};
use pose_sigma_estimate::estimate_pose_sigma;
use registration_problem::RegistrationProblem;
use registration_scan::RegistrationScan;
use strategy::Strategy;

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
    let strategy = Strategy::new(params);
    let pose_sigma = pose_sigma.unwrap_or_else(|| {
        let exact = PoseSigma { translation: 0.0, rotation: 0.0 };
        estimate_pose_sigma(&sample_all(scans, exact, &strategy), robot)
    });
    let sampled = sample_all(scans, pose_sigma, &strategy);
    let scans: Vec<&RegistrationScan> = sampled.iter().collect();
    let strategy = &strategy;
    RegistrationProblem { scans: &scans, robot, pose_sigma, strategy, progress }.solve()
}

fn sample_all(
    scans: &[PreparedScan],
    sigma: PoseSigma,
    strategy: &Strategy,
) -> Vec<RegistrationScan> {
    scans.iter().map(|scan| RegistrationScan::new(scan, sigma, strategy)).collect()
}

#[cfg(test)]
mod growth_tests;
#[cfg(test)]
mod sharp_shapes_tests;
#[cfg(test)]
mod symmetric_tests;
#[cfg(test)]
mod tests;
