//! What can be wrong with interface files.

use std::fmt;
use std::path::{Path, PathBuf};

/// A fault in an interface file or folder: where it is, what is wrong, and what to do about it.
#[derive(Debug)]
pub struct Error {
    path: PathBuf,
    line: Option<usize>,
    message: String,
}

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// A fault that has no line, as of a folder.
    pub(crate) fn file(path: &Path, message: impl Into<String>) -> Self {
        Error { path: path.to_path_buf(), line: None, message: message.into() }
    }

    /// A fault in a line; lines count from 1.
    pub(crate) fn line(path: &Path, line: usize, message: impl Into<String>) -> Self {
        Error { path: path.to_path_buf(), line: Some(line), message: message.into() }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}: {}", self.path.display(), self.message),
            None => write!(f, "{}: {}", self.path.display(), self.message),
        }
    }
}

impl std::error::Error for Error {}
