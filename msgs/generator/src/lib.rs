//! Rust types from ROS 2 interface files (.msg, .srv, .action), made by a build script.
//!
//! The generated code expects in the root of its crate: the traits `Interface`, `Service`, `Action` and `TypeVisitor`, the types
//! `SendGoalRequest`, `SendGoalResponse`, `GetResultRequest`, `GetResultResponse` and `FeedbackMessage`, and the module
//! `wire` with the serde functions of long arrays and bounded fields.

mod definition;
mod emit;
mod error;
mod literal;
mod model;
mod parse;
#[cfg(test)]
mod tests;
mod tree;
mod types;

pub use error::{Error, Result};
use std::path::PathBuf;

/// A package: its name, and the folder that holds `msg`, `srv` and `action`.
#[derive(Clone, Debug)]
pub struct Package {
    /// Name as in package.xml.
    pub name: String,
    /// Folder of the package; any of the three folders may be missing.
    pub folder: PathBuf,
}

/// Rust code of all interfaces of the packages. The types of the package `own` stand at the root (`crate::msg::X`),
/// those of the others in a module of their own (`crate::sensor_msgs::msg::X`). The same files give the same code.
///
/// # Errors
/// The first fault in the files, with file and line.
pub fn generate(packages: &[Package], own: &str) -> Result<String> {
    Ok(emit::code(&tree::read(packages)?, own))
}
