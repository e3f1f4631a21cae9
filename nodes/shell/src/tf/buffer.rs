//! Transforms of the last seconds, and what lies between them.

use super::tree::Tree;
use super::{TfError, Transform};
use crate::Stamp;
use crate::convert::pose_from_transform;
use puffer_core::geometry::Pose;
use puffer_msgs::tf2_msgs::msg::TFMessage;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;

/// As long as tf2 keeps transforms.
const WINDOW: Duration = Duration::from_secs(10);

/// Transforms of the last seconds; clones share it. Needs no node: a bag's transforms may be inserted.
///
/// A frame may change its parent: each transform counts with the parent that it names. A slash before a frame's name is
/// left out.
#[derive(Clone, Debug)]
pub struct TfBuffer {
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    tree: Mutex<Tree>,
    changed: Notify,
    window: Duration,
}

impl Default for TfBuffer {
    /// Keeps 10 s.
    fn default() -> Self {
        Self::new(WINDOW)
    }
}

impl TfBuffer {
    /// A buffer that keeps the last `window` of stamps for each frame; `Duration::MAX` keeps all.
    pub fn new(window: Duration) -> Self {
        let (tree, changed) = (Mutex::default(), Notify::new());
        Self { shared: Arc::new(Shared { tree, changed, window }) }
    }

    /// Adds a transform; a static one holds for all times. Of two with the same child and stamp the later one counts.
    /// A stamp that lies more than the window before the frame's newest one means that time began anew: the frame's
    /// earlier transforms are forgotten.
    pub fn insert(&self, transform: Transform, is_static: bool) {
        self.tree().insert(named(transform), is_static, self.shared.window);
        self.shared.changed.notify_waiters();
    }

    /// Adds the transforms of a message, as [`TfBuffer::insert`] does.
    ///
    /// # Errors
    /// A transform that is no rigid one, or whose frames are the same or without a name, in words; the others of
    /// the message are added all the same.
    pub fn insert_message(&self, message: &TFMessage, is_static: bool) -> Result<(), String> {
        let mut faults = Vec::new();
        for transform in &message.transforms {
            let (parent, child) = (&transform.header.frame_id, &transform.child_frame_id);
            let stamp = Stamp::new(transform.header.stamp.sec, transform.header.stamp.nanosec);
            let checked = checked_names(parent, child)
                .and_then(|()| pose_from_transform(&transform.transform));
            match checked {
                Ok(pose) => {
                    let (parent, child) = (parent.clone(), child.clone());
                    self.insert(Transform { parent, child, stamp, pose }, is_static);
                }
                Err(fault) => faults.push(format!("transform {parent} <- {child}: {fault}")),
            }
        }
        if faults.is_empty() { Ok(()) } else { Err(faults.join("; ")) }
    }

    /// `target_from_source` at `stamp`: a sample itself where one has that stamp, else between its neighbours
    /// (linear, and spherical linear for the rotation).
    ///
    /// # Errors
    /// See [`TfError`].
    pub fn lookup(&self, target: &str, source: &str, stamp: Stamp) -> Result<Pose, TfError> {
        self.tree().lookup(bare(target), bare(source), stamp)
    }

    /// `target_from_source` at the newest stamp at which it is known, with that stamp; with stamp 0 where only static
    /// transforms lie between the frames.
    ///
    /// # Errors
    /// See [`TfError`].
    pub fn latest(&self, target: &str, source: &str) -> Result<(Pose, Stamp), TfError> {
        let (target, source) = (bare(target), bare(source));
        let tree = self.tree();
        let stamp = tree.newest(target, source)?;
        Ok((tree.lookup(target, source, stamp)?, stamp))
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
    ) -> Result<Pose, TfError> {
        let sleep = tokio::time::sleep(deadline);
        tokio::pin!(sleep);
        loop {
            let changed = self.shared.changed.notified();
            tokio::pin!(changed);
            // From here on no insertion is missed.
            changed.as_mut().enable();
            let reason = match self.lookup(target, source, stamp) {
                Ok(pose) => return Ok(pose),
                Err(reason) => Box::new(reason),
            };
            tokio::select! {
                () = changed => {}
                () = &mut sleep => {
                    let (target_frame, source_frame) = (bare(target).into(), bare(source).into());
                    return Err(TfError::Deadline { target_frame, source_frame, deadline, reason });
                }
            }
        }
    }

    fn tree(&self) -> MutexGuard<'_, Tree> {
        // A tree is whole after each insertion, also where a thread died.
        self.shared.tree.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn bare(frame: &str) -> &str {
    frame.strip_prefix('/').unwrap_or(frame)
}

fn named(mut transform: Transform) -> Transform {
    for name in [&mut transform.parent, &mut transform.child] {
        if name.starts_with('/') {
            name.remove(0);
        }
    }
    transform
}

fn checked_names(parent: &str, child: &str) -> Result<(), String> {
    match (bare(parent), bare(child)) {
        ("", _) | (_, "") => Err("a frame has no name".into()),
        (parent, child) if parent == child => Err("a frame is its own parent".into()),
        _ => Ok(()),
    }
}
