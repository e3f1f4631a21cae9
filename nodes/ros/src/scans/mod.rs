//! From messages to the intake of scans in core, the same for a running node and for a bag.

mod bag_scans;
mod observation;
mod params;

pub use bag_scans::{PARAMETERS_METADATA_KEY, RUN_METADATA_NAME, is_bag, scans_of_bag};
pub use observation::{observe, scan_label};
pub use params::{RegistrarParams, ScanParams};
