//! From the scans that a sensor takes to registered scans of the object, without any message type.
//!
//! 1. [`Observation`]: a scan with the robot's pose and the bodies that must not be modelled, as
//!    everything stood when the scan was taken; points outside of the [`Region`] are set aside.
//! 2. [`SplitScan`]: the points on robot, gripper and table are cut, at first with a margin for the
//!    error of the robot's pose, later without it, at the estimated pose.
//! 3. [`Intake`]: prepares and registers the rest in the order in which scans arrive, and settles
//!    all poses together when asked to.
//!
//! ```
//! use puffer_core::geometry::{Pose, Scan};
//! use puffer_core::intake::{CutParams, Intake, IntakeParams, Observation, Region, ScanLabel};
//! use puffer_core::register::RegisterParams;
//! use puffer_core::scan::PoseSigma;
//!
//! // A wavy surface of 60 x 60 mm, 0.3 m before the sensor.
//! let points = (0..3600)
//!     .map(|i| {
//!         let (x, y) = ((i % 60) as f32 * 1e-3 - 0.03, (i / 60) as f32 * 1e-3 - 0.03);
//!         [x, y, 0.3 + 5e-3 * (150.0 * x).sin() * (120.0 * y).cos()]
//!     })
//!     .collect();
//! let scan = Scan { points, width: 60, origins: Vec::new() };
//! let region = Region { radius: 0.2, height: 0.4, depth: 0.05 };
//! let pose_sigma = PoseSigma { translation: 3e-3, rotation: 0.01 };
//! let cut = CutParams { region, body_margin: 5e-3, pose_sigma };
//! let mut intake = Intake::new(IntakeParams { cut, register: RegisterParams::default() });
//! let label = ScanLabel { nanoseconds: 0, frame: "camera".to_owned() };
//! intake.add(Observation::new(label, &scan, Pose::identity(), Vec::new(), &region));
//! assert!(intake.state(0).status().is_accepted());
//! ```

mod observation;
mod params;
mod scan_intake;
mod thinning;

pub use observation::{Observation, ScanLabel, SplitScan, posed_bodies};
pub use params::{CutParams, IntakeParams, Region};
pub use scan_intake::{Intake, ScanState};

#[cfg(test)]
mod tests;
