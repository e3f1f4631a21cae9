//! Why a transform is not known.

use crate::Stamp;
use std::time::Duration;

/// Why a transform is not known.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TfError {
    /// No transform has named the frame.
    #[error("frame `{frame}` is unknown; known are {known}")]
    UnknownFrame {
        /// Name of the frame.
        frame: String,
        /// The frames that are known, in one text.
        known: String,
    },
    /// Both frames are known, but no chain of transforms joins them.
    #[error(
        "frames `{target_frame}` and `{source_frame}` are not connected: their roots are `{target_root}` and `{source_root}`"
    )]
    NotConnected {
        /// The target frame of the lookup.
        target_frame: String,
        /// The source frame of the lookup.
        source_frame: String,
        /// Root of the target frame's tree.
        target_root: String,
        /// Root of the source frame's tree.
        source_root: String,
    },
    /// The stamp lies outside of the time over which transforms are kept.
    #[error(
        "{parent} <- {child} at {stamp}: {outside}; there are {count} transforms from {oldest} to {newest}"
    )]
    OutOfRange {
        /// Parent of the link that fails.
        parent: String,
        /// Child of the link that fails.
        child: String,
        /// The stamp of the lookup.
        stamp: Stamp,
        /// How far outside, in words.
        outside: String,
        /// Number of transforms kept for this link.
        count: usize,
        /// Stamp of the oldest of them.
        oldest: Stamp,
        /// Stamp of the newest of them.
        newest: Stamp,
    },
    /// Frames are children of each other in a loop.
    #[error(
        "frame `{frame}` hangs on itself, through `{parent}`; two publishers give it different parents"
    )]
    Loop {
        /// Frame at which the search began.
        frame: String,
        /// Frame that was reached twice.
        parent: String,
    },
    /// The transform was not known before the deadline.
    #[error("no transform {target_frame} <- {source_frame} within {:.1} s: {reason}", deadline.as_secs_f64())]
    Deadline {
        /// The target frame of the lookup.
        target_frame: String,
        /// The source frame of the lookup.
        source_frame: String,
        /// How long the lookup waited (wall time).
        deadline: Duration,
        /// Why the transform was not known at last.
        reason: Box<TfError>,
    },
}
