//! Makes Rust types from ROS 2 interface files (.msg, .srv, .action), for a build script.
//!
//! The generated code expects in the root of its crate: the traits `Interface`, `Service`, `Action`
//! and `TypeVisitor`, the types `SendGoalRequest`, `SendGoalResponse`, `GetResultRequest`,
//! `GetResultResponse` and `FeedbackMessage`, and the module `field_serde` with the serde functions
//! of long arrays and bounded fields.
//!
//! ```
//! use puffer_msgs_generator::{Package, generate};
//!
//! let folder = tempfile::tempdir()?;
//! std::fs::create_dir(folder.path().join("msg"))?;
//! std::fs::write(folder.path().join("msg/Spot.msg"), "float64 radius 0.5 # Metres.\n")?;
//! let package = Package { name: "lamp_msgs".into(), folder: folder.path().into() };
//! let code = generate(&[package], "lamp_msgs")?;
//! assert!(code.contains("pub struct Spot {") && code.contains("/// Metres."));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod file_syntax;
mod interface_error;
mod interface_tree;
mod model;
mod ros2msg_text;
mod rust_code;
#[cfg(test)]
mod tests;
mod type_syntax;
mod value_syntax;

pub use interface_error::{Error, Result};
use std::path::PathBuf;

/// A package: its name, and the folder that holds `msg`, `srv` and `action`.
#[derive(Clone, Debug)]
pub struct Package {
    /// Name as in package.xml.
    pub name: String,
    /// Folder of the package; each of the three folders may be missing.
    pub folder: PathBuf,
}

/// The Rust code of all interfaces of the packages. The types of the package `own` stand at the
/// root of the crate (`crate::msg::X`), those of the others in a module of their own
/// (`crate::sensor_msgs::msg::X`). The same files give the same code.
///
/// # Errors
/// The first fault in the files, with file and line.
pub fn generate(packages: &[Package], own: &str) -> Result<String> {
    Ok(rust_code::generate(&interface_tree::read(packages)?, own))
}
