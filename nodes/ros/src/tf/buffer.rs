//! The transforms of the last seconds, and what lies between them.

use super::frame_tree::FrameTree;
use super::{TfError, Transform};
use crate::Stamp;
use crate::conversions::pose_from_transform;
use puffer_core::geometry::Pose;
use puffer_msgs::tf2_msgs::msg::TFMessage;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;

/// How long transforms are kept by default, as in tf2.
const DEFAULT_WINDOW: Duration = Duration::from_secs(10);

/// The transforms of the last seconds. Clones share the buffer.
///
/// [`Node::tf`](crate::Node::tf) returns the buffer of a node. A buffer needs no node: the
/// transforms of a bag may be inserted.
///
/// A frame may change its parent: each transform counts with the parent that it names. A slash
/// before a frame's name is left out.
///
/// ```
/// use puffer_core::geometry::Pose;
/// use puffer_ros::{Stamp, TfBuffer, TfError, Transform};
///
/// let tf = TfBuffer::default();
/// for (second, x) in [(1, 0.0), (2, 0.5)] {
///     let (parent, child) = ("base".to_owned(), "sensor".to_owned());
///     let pose = Pose::translation(x, 0.0, 0.0);
///     tf.insert(Transform { parent, child, stamp: Stamp::new(second, 0), pose }, false);
/// }
/// // Half way in time is half way in space.
/// let base_from_sensor = tf.lookup("base", "sensor", Stamp::from_seconds(1.5))?;
/// assert_eq!(base_from_sensor.translation.x, 0.25);
/// // Nothing is extrapolated.
/// let late = tf.lookup("base", "sensor", Stamp::from_seconds(2.5));
/// assert!(matches!(late, Err(TfError::OutOfRange { .. })));
/// # Ok::<(), TfError>(())
/// ```
#[derive(Clone, Debug)]
pub struct TfBuffer {
    shared: Arc<BufferState>,
}

#[derive(Debug)]
struct BufferState {
    tree: Mutex<FrameTree>,
    changed: Notify,
    window: Duration,
}

impl Default for TfBuffer {
    /// A buffer that keeps the last 10 s.
    fn default() -> Self {
        Self::new(DEFAULT_WINDOW)
    }
}

impl TfBuffer {
    /// A buffer that keeps the last `window` of stamps of each frame; `Duration::MAX` keeps all.
    pub fn new(window: Duration) -> Self {
        let (tree, changed) = (Mutex::default(), Notify::new());
        Self { shared: Arc::new(BufferState { tree, changed, window }) }
    }

    /// Adds a transform; a static one holds at all times. Of two with the same child and stamp the
    /// later one counts. A stamp that lies more than the window before the frame's newest one means
    /// that time began anew: the frame's earlier transforms are forgotten.
    pub fn insert(&self, transform: Transform, is_static: bool) {
        self.tree().insert(strip_slashes(transform), is_static, self.shared.window);
        self.shared.changed.notify_waiters();
    }

    /// Adds the transforms of a message, as [`TfBuffer::insert`] does.
    ///
    /// # Errors
    /// In words, if a transform is not rigid, or its frames are the same or have no name; the other
    /// transforms of the message are added nevertheless.
    pub fn insert_message(&self, message: &TFMessage, is_static: bool) -> Result<(), String> {
        let mut faults = Vec::new();
        for transform in &message.transforms {
            let (parent, child) = (&transform.header.frame_id, &transform.child_frame_id);
            let stamp = Stamp::from(transform.header.stamp);
            let checked = check_frame_names(parent, child)
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

    /// `target_from_source` at `stamp`, which maps points in coordinates of the frame `source` to
    /// coordinates of the frame `target`. A link that has a transform of that stamp gives it
    /// unchanged; else it is interpolated between its neighbours, linearly for the position and
    /// spherically for the rotation.
    ///
    /// # Errors
    /// See [`TfError`].
    pub fn lookup(&self, target: &str, source: &str, stamp: Stamp) -> Result<Pose, TfError> {
        self.tree().lookup(strip_slash(target), strip_slash(source), stamp)
    }

    /// `target_from_source` at the newest stamp at which it is known, with that stamp. The stamp is
    /// 0 where only static transforms lie between the frames.
    ///
    /// # Errors
    /// See [`TfError`].
    pub fn latest(&self, target: &str, source: &str) -> Result<(Pose, Stamp), TfError> {
        let (target, source) = (strip_slash(target), strip_slash(source));
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
                    let (target_frame, source_frame) = (strip_slash(target).into(), strip_slash(source).into());
                    return Err(TfError::Deadline { target_frame, source_frame, deadline, reason });
                }
            }
        }
    }

    fn tree(&self) -> MutexGuard<'_, FrameTree> {
        // The tree is consistent after each insertion, also where a thread died.
        self.shared.tree.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A frame's name without a slash before it.
fn strip_slash(frame: &str) -> &str {
    frame.strip_prefix('/').unwrap_or(frame)
}

/// The transform without slashes before its frames' names.
fn strip_slashes(mut transform: Transform) -> Transform {
    for name in [&mut transform.parent, &mut transform.child] {
        if name.starts_with('/') {
            name.remove(0);
        }
    }
    transform
}

fn check_frame_names(parent: &str, child: &str) -> Result<(), String> {
    match (strip_slash(parent), strip_slash(child)) {
        ("", _) | (_, "") => Err("a frame has no name".into()),
        (parent, child) if parent == child => Err("a frame is its own parent".into()),
        _ => Ok(()),
    }
}
