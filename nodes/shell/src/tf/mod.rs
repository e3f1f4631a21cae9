//! Transforms between frames over time.

use crate::Stamp;
use anyhow::{Result, bail};
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

/// Transforms of the last seconds; clones share it. Needs no node: a bag's transforms may be inserted.
#[derive(Clone, Debug, Default)]
pub struct TfBuffer {}

impl TfBuffer {
    /// A buffer that keeps the last `window` of stamps for each pair of frames.
    pub fn new(window: Duration) -> Self {
        let _ = window;
        Self {}
    }

    /// Adds a transform; a static one holds for all times.
    pub fn insert(&self, transform: Transform, is_static: bool) {
        let _ = (transform, is_static);
    }

    /// `target_from_source` at `stamp`: a sample itself where one has that stamp, else between its neighbours
    /// (linear, and spherical linear for the rotation).
    ///
    /// # Errors
    /// See [`TfError`].
    pub fn lookup(
        &self,
        target: &str,
        source: &str,
        stamp: Stamp,
    ) -> std::result::Result<Pose, TfError> {
        let _ = (target, stamp);
        Err(TfError::UnknownFrame { frame: source.to_owned(), known: String::new() })
    }

    /// `target_from_source` at the newest stamp at which it is known, with that stamp.
    ///
    /// # Errors
    /// See [`TfError`].
    pub fn latest(
        &self,
        target: &str,
        source: &str,
    ) -> std::result::Result<(Pose, Stamp), TfError> {
        let _ = target;
        Err(TfError::UnknownFrame { frame: source.to_owned(), known: String::new() })
    }

    /// As [`TfBuffer::lookup`], but waits until the transform is known.
    ///
    /// # Errors
    /// [`TfError::Deadline`] after `deadline` of wall time.
    pub async fn wait(
        &self,
        target: &str,
        source: &str,
        stamp: Stamp,
        deadline: Duration,
    ) -> std::result::Result<Pose, TfError> {
        let _ = deadline;
        self.lookup(target, source, stamp)
    }
}

/// Publishes transforms.
#[derive(Clone)]
pub struct TfBroadcaster {}

impl TfBroadcaster {
    /// Publishes on `/tf`.
    ///
    /// # Errors
    /// The queue stayed full.
    pub fn send(&self, transforms: &[Transform]) -> Result<()> {
        bail!("not yet: {}", transforms.len())
    }

    /// Publishes on `/tf_static`, together with all static transforms sent before, so that late joiners get them.
    ///
    /// # Errors
    /// The queue stayed full.
    pub fn send_static(&self, transforms: &[Transform]) -> Result<()> {
        bail!("not yet: {}", transforms.len())
    }
}
