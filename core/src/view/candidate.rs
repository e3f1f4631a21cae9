//! Views that are considered, and the robot's answers for them.

use super::gain::Gain;
use crate::geometry::Pose;

/// How the robot takes a viewpoint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReachedView {
    /// The pose `object_from_sensor` that the robot would take; roll and distance may differ from
    /// what was asked for.
    pub pose: Pose,
    /// Duration of the motion, seconds.
    pub duration: f64,
}

/// Why the robot does not take a viewpoint.
#[derive(Clone, Debug, PartialEq)]
pub struct RefusedView {
    /// The kind of reason, as it is said of a view: "out of reach".
    pub kind: &'static str,
    /// The reason with all that is known.
    pub reason: String,
}

/// Asks the robot whether and how it takes a viewpoint (`object_from_sensor`).
pub(crate) type AskRobot<'a> = &'a mut dyn FnMut(&Pose) -> Result<ReachedView, RefusedView>;

/// A view that was considered.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The pose `object_from_sensor`.
    pub pose: Pose,
    /// Worth under the chosen measure.
    pub gain: f64,
    /// Surface voxels lacking points that its simulated scan sees (N).
    pub lacking: usize,
    /// Possible inside and border voxels that it sees (M).
    pub hidden: usize,
    /// Unknown voxels that it sees (O).
    pub unknown: usize,
    /// Share of its rays into the object that meet known surface, 0 to 1.
    pub overlap: f64,
    /// Whether the robot was asked.
    pub asked: bool,
    /// Whether the robot can take it, if it was asked.
    pub reachable: bool,
    /// Why the robot refuses it, or why it was not chosen; empty if nothing speaks against it.
    pub reason: String,
    /// The kind of reason, if the robot refuses it.
    pub refusal: Option<&'static str>,
}

impl Candidate {
    pub(super) fn new(pose: Pose, gain: &Gain) -> Candidate {
        Candidate {
            pose,
            gain: gain.worth,
            lacking: gain.lacking,
            hidden: gain.hidden,
            unknown: gain.unknown,
            overlap: gain.overlap,
            asked: false,
            reachable: false,
            reason: String::new(),
            refusal: None,
        }
    }

    /// Asks the robot and keeps the answer.
    pub(super) fn ask(&mut self, robot: AskRobot<'_>) -> Option<ReachedView> {
        self.asked = true;
        match robot(&self.pose) {
            Ok(reached) => {
                self.reachable = true;
                Some(reached)
            }
            Err(RefusedView { kind, reason }) => {
                (self.refusal, self.reason) = (Some(kind), reason);
                None
            }
        }
    }
}
