//! Makes Rust types from the interface files: those of this package in msg, srv and action, and
//! those of other packages in standard.

use puffer_msgs_generator::{Package, generate};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Folder of a package for tests only.
const KINDS: &str = "tests/kinds";

fn main() -> ExitCode {
    for folder in ["msg", "srv", "action", "standard", KINDS] {
        println!("cargo::rerun-if-changed={folder}");
    }
    match write() {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            println!("cargo::error={message}");
            ExitCode::FAILURE
        }
    }
}

fn write() -> Result<(), String> {
    let out = std::env::var("OUT_DIR").map_err(|e| format!("OUT_DIR: {e}; build with cargo"))?;
    let mut packages = packages()?;
    write_code(&packages, &Path::new(&out).join("interfaces.rs"))?;
    packages.push(Package { name: "kinds".into(), folder: KINDS.into() });
    write_code(&packages, &Path::new(&out).join("interfaces_and_kinds.rs"))
}

fn write_code(packages: &[Package], file: &Path) -> Result<(), String> {
    let code = generate(packages, "puffer_msgs").map_err(|e| e.to_string())?;
    std::fs::write(file, code).map_err(|e| format!("cannot write {}: {e}", file.display()))
}

/// This package, and each folder of `standard`.
fn packages() -> Result<Vec<Package>, String> {
    let mut packages = vec![Package { name: "puffer_msgs".into(), folder: PathBuf::from(".") }];
    for entry in std::fs::read_dir("standard").map_err(read_error)? {
        let entry = entry.map_err(read_error)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        packages.push(Package { name, folder: entry.path() });
    }
    packages.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(packages)
}

fn read_error(error: std::io::Error) -> String {
    format!("cannot read the folder standard: {error}")
}
