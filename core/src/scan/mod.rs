//! A scan made ready for registration and filtering, and the facts about a scan that every stage
//! shares.
//!
//! [`PreparedScan`] holds the oriented points of one scan with their noise; [`PoseSigma`] says how
//! well the robot knows its poses, [`SensorKind`] what took the scan, [`Support`] what the object
//! stands on.
//!
//! ```
//! use puffer_core::geometry::{Scan, Vec3};
//! use puffer_core::scan::PreparedScan;
//!
//! // A plane across the sensor's axis, points 1 mm apart.
//! let points = (0..900).map(|i| [(i % 30) as f32 * 1e-3, (i / 30) as f32 * 1e-3, 0.3]).collect();
//! let prepared = PreparedScan::new(&Scan { points, width: 30, origins: Vec::new() })?;
//! assert!((prepared.spacing - 1e-3).abs() < 1e-5);
//! assert!(prepared.normals.iter().all(|normal| normal.dot(&-Vec3::z()) > 0.999));
//! # Ok::<(), puffer_core::Error>(())
//! ```

mod normals;
mod pose_sigma;
mod prepared;
mod returns;
mod sensor_kind;
mod spacing;
mod support;

pub use pose_sigma::PoseSigma;
pub use prepared::{PreparedScan, Unoriented};
pub use sensor_kind::SensorKind;
pub use support::Support;
