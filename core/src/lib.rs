//! Every algorithm of puffer, without ROS, clock or printing.
//!
//! A module may use only the modules that stand above it in this list; a test checks that. Lengths
//! are metres, angles radians, and transforms are named `a_from_b`.

pub mod error;
pub mod params;
pub mod progress;

pub mod geometry;
pub mod mesh;
pub mod voxel;

pub mod scan;
pub mod scan_files;

pub mod robot;

pub mod register;

pub mod intake;

pub mod filter;

pub mod reconstruct;

pub mod verdict;

pub mod pipeline;

pub mod view;

pub mod planner;

pub mod session;

pub mod simulate;

pub mod assess;

pub use error::{Error, Result};
pub use progress::Progress;
