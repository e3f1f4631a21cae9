//! The verdict on the whole model in the output of commands.

use crate::table::ResultTable;
use anyhow::{Result, anyhow};
use puffer_core::verdict::ModelVerdict;

/// Adds the verdict to the table and its keys to the JSON object.
pub(crate) fn add_verdict(report: &mut ResultTable, verdict: &ModelVerdict) {
    let trustworthy = verdict.distrust_reason().is_none();
    report.add("verdict", verdict.summary(), "trustworthy", trustworthy);
    for (key, value) in verdict.to_json() {
        report.add_value(&key, value);
    }
}

/// Accepts a mesh that is trustworthy, and with `force` any other: the reason against it is then
/// printed as a warning.
///
/// # Errors
/// Why the mesh is not trustworthy, and `how` to get it all the same.
pub(crate) fn ensure_trustworthy(verdict: &ModelVerdict, force: bool, how: &str) -> Result<()> {
    match verdict.distrust_reason() {
        None => Ok(()),
        Some(reason) if force => {
            eprintln!("puffer: warning: {reason}");
            Ok(())
        }
        Some(reason) => Err(anyhow!("{reason}; the mesh is not written: {how}")),
    }
}
