//! Simulated scans as the benchmarks of registration and filter use them.

use anyhow::{Context, Result};
use puffer::exit_status::usage_error;
use puffer_core::params::ParamValue;
use puffer_core::scan::PreparedScan;
use puffer_core::simulate::{NoiseFamily, SimulatedScans};
use serde_json::Value;

/// The noise family that the command line names.
///
/// # Errors
/// Wrong usage if there is no family of that name.
pub(crate) fn parse_noise_family(word: &str) -> Result<NoiseFamily> {
    NoiseFamily::from_value(&Value::from(word)).ok_or_else(|| {
        usage_error(format!("--noise {word}: there is {}", NoiseFamily::CHOICES.join(", ")))
    })
}

/// The scans with normals and curvatures, as registration and filter take them.
///
/// # Errors
/// A scan that cannot be prepared; the message names its view.
pub(crate) fn prepare_scans(scans: &SimulatedScans) -> Result<Vec<PreparedScan>> {
    let views = scans.views.iter().enumerate();
    views.map(|(i, v)| PreparedScan::new(&v.scan).with_context(|| format!("view {i}"))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn families_are_parsed_by_name() {
        assert_eq!(parse_noise_family("P2K").unwrap(), NoiseFamily::P2K);
        let error = parse_noise_family("p9").unwrap_err().to_string();
        assert!(error.starts_with("--noise p9: there is P1"), "{error}");
    }
}
