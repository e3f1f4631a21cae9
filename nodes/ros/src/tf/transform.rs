//! A transform between two frames.

use crate::Stamp;
use puffer_core::geometry::Pose;

/// The pose of the frame `child` in the frame `parent` at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct Transform {
    /// Name of the frame in which the pose is given.
    pub parent: String,
    /// Name of the frame whose pose it is.
    pub child: String,
    /// When the pose holds; a static transform holds at all times.
    pub stamp: Stamp,
    /// `parent_from_child`: it maps points in coordinates of `child` to coordinates of `parent`,
    /// metres.
    pub pose: Pose,
}
