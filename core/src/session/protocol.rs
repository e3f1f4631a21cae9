//! Events that a session reacts to, and commands that it gives.

use crate::register::Status;

/// What the session is waiting for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// All nodes to be there.
    Preparing,
    /// The planner's next view.
    Planning,
    /// The robot to reach the view.
    Moving,
    /// The sensor to deliver a scan.
    Scanning,
    /// The registrar's verdict on the scan.
    Registering,
    /// The joint optimisation of all poses.
    Refining,
    /// The filtered cloud.
    Filtering,
    /// The mesh.
    Reconstructing,
    /// The operator, who paused the session.
    Paused,
    /// Nothing: the session has ended.
    Done,
}

/// What happened, as the caller reports it.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// All nodes are there.
    Ready,
    /// The planner found a view.
    Planned {
        /// Share of the known surface that holds its measurements, 0 to 1.
        coverage: f64,
        /// What the view is expected to gain.
        gain: f64,
    },
    /// The planner has no view left.
    NoViewLeft {
        /// Share of the known surface that holds its measurements, 0 to 1.
        coverage: f64,
        /// Why there is none.
        reason: String,
    },
    /// The robot is at the view.
    Moved,
    /// The sensor delivered a scan.
    Scanned,
    /// The registrar's verdict on the scan.
    Registered(Status),
    /// The current command, [`Command::Refine`] or [`Command::Filter`], succeeded.
    Finished,
    /// The mesh is reconstructed.
    Reconstructed {
        /// Mean standard deviation of its vertices, metres.
        sigma: f64,
    },
    /// The current command failed, for the reason given.
    Failed(String),
    /// The operator wants to pause before the next motion.
    Pause,
    /// The operator wants to go on.
    Resume,
    /// The operator wants to end at once.
    Cancel,
}

/// What is to be done next.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Plan the next view, when `scans` scans are taken into account.
    Plan {
        /// Number of scans.
        scans: usize,
        /// Points that a surface voxel needs, as a multiple of the configured number.
        point_factor: usize,
    },
    /// Move to the planned view.
    Move,
    /// Take a scan.
    Scan,
    /// Wait for the verdict on scan `index`, counted from 0.
    AwaitVerdict {
        /// Number of the scan.
        index: usize,
    },
    /// Optimise the poses of all `scans` scans.
    Refine {
        /// Number of scans.
        scans: usize,
    },
    /// Filter all `scans` scans.
    Filter {
        /// Number of scans.
        scans: usize,
    },
    /// Reconstruct the mesh.
    Reconstruct,
    /// Wait until the operator resumes.
    WaitForResume,
    /// End the session.
    End(SessionOutcome),
}

/// How a session ended.
#[derive(Clone, Debug, PartialEq)]
pub enum SessionOutcome {
    /// With a mesh; the text says why no more scans were taken.
    Modelled(String),
    /// Without a mesh; the phase in which it failed, and the reason.
    Failed(Phase, String),
    /// The operator cancelled it.
    Cancelled,
}
