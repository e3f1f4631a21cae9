//! The errors of this crate: broken input and I/O. An outcome (an alignment that did not converge,
//! a view without gain) is a value, never an error.

use std::path::{Path, PathBuf};

/// What can go wrong. Every text says what was wrong, where, and what to do about it.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file or folder could not be read or written.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// What was tried: "read", "write", "create".
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file was read but does not hold what its format asks for.
    #[error("{}: {message}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong, where in the file, and what to change.
        message: String,
    },
    /// The data are well-formed but unfit for the operation (too few points, a plane, wrong unit).
    #[error("{0}")]
    Input(String),
    /// A parameter is unknown, of the wrong type or out of its range.
    #[error("parameter {name}: {message}")]
    Parameter {
        /// The parameter's full name, `group.field`.
        name: String,
        /// What is wrong and what is allowed.
        message: String,
    },
    /// The work was cancelled through [`crate::Progress`].
    #[error("interrupted")]
    Cancelled,
}

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An I/O error with the action ("read", "write", "create") and the path that it concerns.
    pub fn io(action: &'static str, path: &Path, source: std::io::Error) -> Self {
        Error::Io { action, path: path.to_path_buf(), source }
    }

    /// A format error in the file at `path`.
    pub fn format(path: &Path, message: impl Into<String>) -> Self {
        Error::Format { path: path.to_path_buf(), message: message.into() }
    }

    /// Unfit data.
    pub fn input(message: impl Into<String>) -> Self {
        Error::Input(message.into())
    }
}
