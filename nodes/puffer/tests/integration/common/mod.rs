//! Running the program.

pub mod processes;

use std::path::Path;
use std::process::{Command, Output};

pub const PUFFER: &str = env!("CARGO_BIN_EXE_puffer");

pub fn puffer(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(PUFFER).args(arguments).current_dir(folder).output().unwrap()
}

/// What the program printed; it must have succeeded.
pub fn stdout(folder: &Path, arguments: &[&str]) -> String {
    let output = puffer(folder, arguments);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {}: {said}", output.status);
    String::from_utf8(output.stdout).unwrap()
}

pub fn json(folder: &Path, arguments: &[&str]) -> serde_json::Value {
    serde_json::from_str(&stdout(folder, arguments)).unwrap()
}
