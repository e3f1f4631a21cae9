//! From clouds and transforms to registered scans, the same for a running node and for a bag.

mod bag;
mod intake;
mod observation;
mod params;

pub use bag::{NOTES, PARAMETER_NOTE, is_bag, scans_of_bag};
pub use intake::{Intake, Registered};
pub use observation::Observation;
pub use params::{RegistrarParams, ScanParams};
