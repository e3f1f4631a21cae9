//! The verdict on the whole, as the commands tell it.

use crate::table::Report;
use anyhow::{Result, anyhow};
use puffer_core::verdict::ModelVerdict;

/// Adds the verdict to the table and its keys to the JSON object.
pub(crate) fn add(report: &mut Report, verdict: &ModelVerdict) {
    let trustworthy = verdict.distrust().is_none();
    report.add("verdict", verdict.summary(), "trustworthy", trustworthy);
    for (key, value) in verdict.facts() {
        report.add_value(&key, value);
    }
}

/// Lets a mesh pass that is trustworthy, or wanted all the same: then the reason against it is told
/// as a warning.
///
/// # Errors
/// Why the mesh is not trustworthy, and `how` to have it all the same.
pub(crate) fn pass(verdict: &ModelVerdict, force: bool, how: &str) -> Result<()> {
    match verdict.distrust() {
        None => Ok(()),
        Some(reason) if force => {
            eprintln!("puffer: warning: {reason}");
            Ok(())
        }
        Some(reason) => Err(anyhow!("{reason}; the mesh is not written: {how}")),
    }
}
