//! From clouds and transforms to registered scans, the same for a running node and for a bag.

mod intake;
mod observation;
mod params;

pub use intake::{Intake, Registered};
pub use observation::Observation;
pub use params::{RegistrarParams, ScanParams};
