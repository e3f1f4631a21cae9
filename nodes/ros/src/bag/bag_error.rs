//! What can go wrong with a bag.

use std::io;
use std::path::{Path, PathBuf};

/// Why a bag could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum BagError {
    /// The operating system could not read or write a file or folder.
    #[error("bag {}: cannot {doing}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried, such as "open".
        doing: &'static str,
        /// What the operating system said.
        source: io::Error,
    },
    /// The path is no bag of a format that is read here.
    #[error("{} is no MCAP bag: {reason}", path.display())]
    NotABag {
        /// The file or folder.
        path: PathBuf,
        /// What it is instead, and what to do.
        reason: String,
    },
    /// The file is damaged where it is read.
    #[error("bag {}: damaged at byte {at}: {reason}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Position in the file, bytes.
        at: u64,
        /// What is wrong.
        reason: String,
    },
    /// A topic or a message of it cannot be written.
    #[error("bag {}: topic {topic}: {reason}", path.display())]
    Topic {
        /// The file.
        path: PathBuf,
        /// ROS name of the topic.
        topic: String,
        /// What is wrong.
        reason: String,
    },
    /// A message is of another type than was asked for, or its bytes do not fit its type.
    #[error("topic {topic} in the bag at {time}: {reason}")]
    Message {
        /// ROS name of the topic.
        topic: String,
        /// Log time of the message.
        time: crate::Stamp,
        /// What is wrong.
        reason: String,
    },
}

impl BagError {
    /// The error of an operation on `path`, from what the operating system said.
    pub(crate) fn io(path: &Path, doing: &'static str) -> impl FnOnce(io::Error) -> BagError {
        let path = path.to_owned();
        move |source| BagError::Io { path, doing, source }
    }

    pub(crate) fn not_a_bag(path: &Path, reason: impl Into<String>) -> BagError {
        BagError::NotABag { path: path.to_owned(), reason: reason.into() }
    }
}
