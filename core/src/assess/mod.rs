//! The quality of meshes, filtered clouds and registered poses: one definition of each figure for
//! all programs.
//!
//! [`assess()`] measures a mesh against the truth. Distances from samples to triangles are exact.
//! cRMS is the distance of the result's samples to the truth after point-to-plane ICP from the
//! identity (Wiedemann 2014, §3); all other distances are taken after the same alignment, and once
//! more before it. [`filter_figures()`] measures a filtered cloud, [`pose_errors()`] registered
//! poses, [`run_pair_trials`] the verdicts on pairs of scans, and [`RecoveryTest`] registration on
//! scans without a truth.
//!
//! ```
//! use puffer_core::Progress;
//! use puffer_core::assess::{AssessParams, assess};
//! use puffer_core::geometry::{Aabb, Pose, Vec3};
//! use puffer_core::mesh::isosurface::Lattice;
//!
//! let bounds = Aabb { min: Vec3::repeat(-0.06), max: Vec3::repeat(0.06) };
//! let ball = Lattice::sample(&bounds, 5e-3, |p| p.norm() - 0.05).extract_isosurface();
//! let moved = ball.transformed(&Pose::translation(1e-3, 0.0, 0.0));
//! let params = AssessParams { samples: 1000, ..AssessParams::default() };
//! let assessment = assess(&moved, &ball, &params, &Progress::silent())?;
//! assert!(assessment.topology.closed);
//! // Millimetres, before and after the alignment.
//! assert!(assessment.raw.0.accuracy_rms > 0.3 && assessment.aligned.accuracy_rms < 0.05);
//! # Ok::<(), puffer_core::Error>(())
//! ```

mod assessment;
mod calibration;
mod distances;
mod estimation_limit;
#[cfg(test)]
mod filter_edge_tests;
mod filter_figures;
mod pair_trials;
mod params;
mod perturbation;
mod pose_errors;
mod pose_recovery;
mod reference_surface;
#[cfg(test)]
mod registration_tests;
mod statistics;
mod surface_icp;
mod surface_samples;
mod topology;
mod true_measurement;

pub use assessment::{Assessment, assess};
pub use calibration::{SigmaCalibration, assess_sigma};
pub use distances::{DistanceSummary, Distances, RawDistances};
pub use filter_figures::{FilterFigures, filter_figures};
pub use pair_trials::{PairTrial, TrialKind, TrialScan, prepare_trial_scans, run_pair_trials};
pub use params::AssessParams;
pub use perturbation::{PoseDifference, perturb_pose, pose_differences};
pub use pose_errors::{PoseErrors, PosedHits, pair_error, pose_errors};
pub use pose_recovery::{RecoveredPose, RecoveryTest};
pub use reference_surface::{NearestPoint, ReferenceSurface, distances_to_open_truth};
pub use statistics::quantile;
pub use surface_icp::{SurfaceAlignment, align_to_surface};
pub use surface_samples::{SurfaceSample, sample_surface};
pub use topology::{Topology, assess_topology};
