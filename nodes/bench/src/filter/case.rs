//! What one run of the filter benchmark filters.

use puffer_core::simulate::NoiseFamily;

/// Scans of one object by one simulated sensor.
#[derive(Clone)]
pub(super) struct FilterCase {
    pub object: String,
    pub family: NoiseFamily,
    /// Share of the points that are outliers.
    pub outliers: f64,
    pub seed: u64,
}

impl FilterCase {
    /// Object, noise family and share of outliers, in columns.
    pub(super) fn label(&self) -> String {
        let noise = format!("{:?}", self.family);
        format!("{:<12} {noise:<4} {:>5.1} %", self.object, self.outliers * 100.0)
    }
}
