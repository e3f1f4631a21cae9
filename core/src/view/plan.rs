//! The outcome of planning.

use super::candidate::Candidate;
use super::termination::Termination;
use super::voxel_state::VoxelCounts;
use crate::geometry::Pose;

/// The next view.
#[derive(Clone, Debug, PartialEq)]
pub struct ChosenView {
    /// The pose `object_from_sensor` that the robot will take.
    pub pose: Pose,
    /// Index in [`Plan::candidates`].
    pub candidate: usize,
    /// Worth of that pose under the chosen measure; 0 for a predefined view.
    pub gain: f64,
    /// Voxels of N and M that it is expected to show.
    pub expected_new: usize,
    /// Duration of the motion, seconds.
    pub duration: f64,
}

/// The outcome of planning.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The next view; `None` when done.
    pub chosen: Option<ChosenView>,
    /// The views that were considered, best first.
    pub candidates: Vec<Candidate>,
    /// [`VoxelCounts::coverage`].
    pub coverage: f64,
    /// Numbers of voxels.
    pub counts: VoxelCounts,
    /// Why no view is left; `None` if one was chosen.
    pub done: Option<Termination>,
}
