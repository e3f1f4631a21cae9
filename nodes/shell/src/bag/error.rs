//! What can go wrong.

use std::io;
use std::path::{Path, PathBuf};

/// Why a bag could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum BagError {
    /// The file system refused.
    #[error("bag {}: cannot {doing}: {source}", path.display())]
    Io {
        /// File or folder.
        path: PathBuf,
        /// What was tried.
        doing: &'static str,
        /// What the system said.
        source: io::Error,
    },
    /// The path is no bag that can be read here.
    #[error("{} is no MCAP bag: {reason}", path.display())]
    NoBag {
        /// File or folder.
        path: PathBuf,
        /// What it is instead, and what to do.
        reason: String,
    },
    /// The file is damaged where it is read.
    #[error("bag {}: damaged at byte {at}: {reason}", path.display())]
    Damaged {
        /// File.
        path: PathBuf,
        /// Place in the file.
        at: u64,
        /// What is wrong.
        reason: String,
    },
    /// A topic cannot be written so.
    #[error("bag {}: topic {topic}: {reason}", path.display())]
    Topic {
        /// File.
        path: PathBuf,
        /// ROS name of the topic.
        topic: String,
        /// What is wrong.
        reason: String,
    },
    /// A message is not what its type says.
    #[error("topic {topic} in the bag at {time}: {reason}")]
    Message {
        /// ROS name of the topic.
        topic: String,
        /// When it was recorded.
        time: crate::Stamp,
        /// What is wrong.
        reason: String,
    },
}

impl BagError {
    pub(crate) fn io(path: &Path, doing: &'static str) -> impl FnOnce(io::Error) -> BagError {
        let path = path.to_owned();
        move |source| BagError::Io { path, doing, source }
    }

    pub(crate) fn no_bag(path: &Path, reason: impl Into<String>) -> BagError {
        BagError::NoBag { path: path.to_owned(), reason: reason.into() }
    }
}
