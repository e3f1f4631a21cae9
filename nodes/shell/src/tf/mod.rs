//! Transforms between frames over time.

mod broadcaster;
mod buffer;
mod samples;
#[cfg(test)]
mod tests;
mod tree;

use crate::Stamp;
pub use broadcaster::TfBroadcaster;
pub(crate) use broadcaster::subscribe;
pub use buffer::TfBuffer;
use puffer_core::geometry::Pose;
use std::time::Duration;

/// A transform at a time: `parent_from_child`.
#[derive(Clone, Debug, PartialEq)]
pub struct Transform {
    /// Frame in which the pose is given.
    pub parent: String,
    /// Frame whose pose it is.
    pub child: String,
    /// When it holds.
    pub stamp: Stamp,
    /// `parent_from_child`.
    pub pose: Pose,
}

/// Why a transform is not known.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TfError {
    /// No transform has named the frame.
    #[error("frame `{frame}` is unknown; known are {known}")]
    UnknownFrame {
        /// The frame.
        frame: String,
        /// The frames that are known.
        known: String,
    },
    /// Both frames are known, but no chain of transforms joins them.
    #[error(
        "frames `{target_frame}` and `{source_frame}` are not connected: their roots are `{target_root}` and `{source_root}`"
    )]
    NotConnected {
        /// Frame asked for.
        target_frame: String,
        /// Frame asked from.
        source_frame: String,
        /// Root of the first.
        target_root: String,
        /// Root of the second.
        source_root: String,
    },
    /// The stamp lies outside of what is kept.
    #[error(
        "{parent} <- {child} at {stamp}: {outside}; there are {count} transforms from {oldest} to {newest}"
    )]
    OutOfRange {
        /// Parent of the link that fails.
        parent: String,
        /// Child of the link that fails.
        child: String,
        /// Stamp asked for.
        stamp: Stamp,
        /// By how much, in words.
        outside: String,
        /// Transforms kept for this link.
        count: usize,
        /// Oldest of them.
        oldest: Stamp,
        /// Newest of them.
        newest: Stamp,
    },
    /// Frames hang on each other in a circle.
    #[error(
        "frame `{frame}` hangs on itself, through `{parent}`; two publishers give it different parents"
    )]
    Loop {
        /// Where the walk began.
        frame: String,
        /// The frame that was met twice.
        parent: String,
    },
    /// The deadline passed; the last reason stands inside.
    #[error("no transform {target_frame} <- {source_frame} within {:.1} s: {reason}", deadline.as_secs_f64())]
    Deadline {
        /// Frame asked for.
        target_frame: String,
        /// Frame asked from.
        source_frame: String,
        /// How long was waited (wall time).
        deadline: Duration,
        /// Why not.
        reason: Box<TfError>,
    },
}
