//! Whether the robot can take a view that is being planned.

use crate::geometry::Pose;
use crate::robot::{Obstacle, Reachability, ReachabilityRequest, ViewMotion, Workcell};
use crate::view::{ReachedView, RefusedView};

/// Queries whether the robot can take views, all from the same start, and keeps the motions that
/// were found.
pub(super) struct ReachQuery<'a> {
    pub(super) workcell: &'a Workcell,
    /// Where the motions start: a position for each joint.
    pub(super) start: &'a [f64],
    pub(super) obstacle: &'a Obstacle,
    /// Length of the sensor's sweep, metres.
    pub(super) sweep: f64,
    /// Range in which the distance to the object may differ, metres; see
    /// [`ReachabilityRequest::slide`].
    pub(super) slide: [f64; 2],
    /// Minimum clearance between bodies, metres.
    pub(super) margin: f64,
    /// Whether the object stands on a table at z = 0 of the object frame.
    pub(super) on_table: bool,
    /// The motions found so far.
    pub(super) found: Vec<ViewMotion>,
}

impl ReachQuery<'_> {
    /// How the robot takes the viewpoint `view` (`object_from_sensor`), or why it does not.
    pub(super) fn ask(&mut self, view: &Pose) -> Result<ReachedView, RefusedView> {
        if self.on_table && view.translation.z <= 0.0 {
            // The table reaches farther than the region of interest, where simulated scans do not
            // see it.
            return Err(RefusedView {
                kind: "from below the table",
                reason: "the table hides the object from below".to_owned(),
            });
        }
        let request = ReachabilityRequest {
            view: *view,
            start: self.start,
            sweep: self.sweep,
            slide: self.slide,
            obstacle: self.obstacle,
            margin: self.margin,
        };
        match self.workcell.check_reachability(&request) {
            Ok(Reachability::Reachable(motion)) => {
                let (pose, duration) = (motion.object_from_sensor, motion.duration);
                self.found.push(*motion);
                Ok(ReachedView { pose, duration })
            }
            Ok(Reachability::Unreachable { cause, reason }) => {
                Err(RefusedView { kind: cause.describe(), reason })
            }
            Err(error) => Err(RefusedView {
                kind: "that the robot cannot be asked for",
                reason: error.to_string(),
            }),
        }
    }

    /// The motion that takes the sensor to exactly `pose`.
    pub(super) fn take_motion(self, pose: &Pose) -> Option<ViewMotion> {
        self.found.into_iter().find(|motion| motion.object_from_sensor == *pose)
    }
}
