//! What one run of the registration benchmark registers.

use puffer_core::simulate::NoiseFamily;

/// Scans of one object by one simulated sensor.
#[derive(Clone)]
pub(super) struct RegistrationCase {
    pub object: String,
    pub family: NoiseFamily,
    pub seed: u64,
}

impl RegistrationCase {
    /// A name for files and messages.
    pub(super) fn name(&self) -> String {
        format!("{}_{:?}_{}", self.object, self.family, self.seed)
    }
}
