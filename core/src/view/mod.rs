//! Next best view (Wiedemann 2014, §2.2.1).
//!
//! [`ViewSpace`] integrates scans and knows of each voxel whether it is free, a surface, or hidden
//! behind one. [`next_view`] derives candidate viewpoints from it, evaluates the gain of a
//! simulated scan from each, and asks the robot for the best. Candidates and gains are functions of
//! the space alone, so that a plan can be repeated from the scans.
//!
//! ```
//! use puffer_core::geometry::{Aabb, SensorModel, StereoModel, Vec3};
//! use puffer_core::view::{ReachedView, ViewParams, ViewSpace, next_view};
//!
//! let region = Aabb { min: Vec3::repeat(-0.1), max: Vec3::repeat(0.1) };
//! let sensor = SensorModel::Stereo(StereoModel::GUPPY);
//! let space = ViewSpace::new(sensor, region, &ViewParams::default())?;
//! // A robot that takes every view within two seconds.
//! let plan = next_view(&space, &mut |pose| Ok(ReachedView { pose: *pose, duration: 2.0 }));
//! assert_eq!(plan.chosen.map(|view| view.candidate), Some(0));
//! # Ok::<(), puffer_core::Error>(())
//! ```

mod candidate;
mod carving;
mod choice;
mod gain;
mod params;
mod plan;
mod preset_views;
mod random;
mod simulated_scan;
mod space;
mod termination;
mod update;
mod viewpoints;
mod voxel_state;

pub use candidate::{Candidate, ReachedView, RefusedView};
pub use choice::next_view;
pub use params::{GainMeasure, Utility, ViewParams};
pub use plan::{ChosenView, Plan};
pub use space::ViewSpace;
pub use termination::{Termination, TerminationCause};
pub(crate) use viewpoints::looking_along;
pub use voxel_state::{VoxelCounts, VoxelState};

#[cfg(test)]
mod tests;

#[cfg(test)]
mod loop_tests;
