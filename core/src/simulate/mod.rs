//! Simulated objects, sensors and robots.
//!
//! A [`Simulator`] scans a closed mesh with one of two sensors: a laser striper swept by an arm, or
//! a stereo pair. Each point of a scan comes with its noise-free hit and a label, each view with
//! its true pose and the pose that the robot reports. All random numbers depend on the seed, the
//! view and the row alone, so that results depend neither on the number of threads nor on the order
//! of the views.
//!
//! ```
//! use puffer_core::Progress;
//! use puffer_core::geometry::{Aabb, Vec3};
//! use puffer_core::mesh::isosurface::Lattice;
//! use puffer_core::simulate::{SimulateParams, simulate};
//!
//! let bounds = Aabb { min: Vec3::repeat(-0.06), max: Vec3::repeat(0.06) };
//! let ball = Lattice::sample(&bounds, 5e-3, |p| p.norm() - 0.05).extract_isosurface();
//! let params = SimulateParams {
//!     views: 2,
//!     point_spacing: 2e-3,
//!     profile_spacing: 2e-3,
//!     ..SimulateParams::default()
//! };
//! let scans = simulate(&ball, &params, 1, &Progress::silent())?;
//! assert_eq!(scans.views.len(), 2);
//! assert!(scans.views.iter().all(|view| view.scan.returns().count() > 100));
//! # Ok::<(), puffer_core::Error>(())
//! ```

mod depth_edge;
mod labels;
mod laser;
mod noise_family;
pub mod objects;
mod params;
mod pose_error;
mod random;
mod scene;
mod sensor_output;
mod simulated_cell;
mod simulated_view;
mod simulator;
mod stereo;
mod true_noise;
mod view_poses;

pub use labels::{FLYING_LABEL, GOOD_LABEL, OUTLIER_LABEL, SURROUNDINGS_LABEL};
pub use noise_family::NoiseFamily;
pub use params::SimulateParams;
pub(crate) use random::random_direction;
pub use simulated_cell::{SimulatedCell, setup_sensor};
pub use simulated_view::{SimulatedScans, SimulatedView};
pub use simulator::{Simulator, simulate};
pub use true_noise::{TrueNoise, add_outliers, outlier_share};
pub use view_poses::view_poses;

#[cfg(test)]
mod tests;
