//! What a session is told, and what it wants done.

use crate::register::Status;

/// What the session is waiting for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The start.
    Preparing,
    /// The next view.
    Planning,
    /// The robot.
    Moving,
    /// The sensor.
    Scanning,
    /// The verdict on the scan.
    Registering,
    /// The joint optimisation.
    Refining,
    /// The cloud.
    Filtering,
    /// The mesh.
    Reconstructing,
    /// The operator, who paused it.
    Paused,
    /// Nothing more.
    Done,
}

/// What happened.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// All partners are there.
    Ready,
    /// The planner found a view.
    Planned {
        /// Share of the known surface that holds its measurements, 0 to 1.
        coverage: f64,
        /// What the view is expected to gain.
        gain: f64,
    },
    /// The planner has no view left; why.
    NothingLeft {
        /// As for [`Event::Planned`].
        coverage: f64,
        /// Why there is none.
        reason: String,
    },
    /// The robot stands at the view.
    Moved,
    /// The sensor delivered.
    Scanned,
    /// The registrar's verdict on the scan.
    Registered(Status),
    /// The current command succeeded (refine, filter).
    Finished,
    /// The mesh is made.
    Reconstructed {
        /// Mean standard deviation of its vertices, metres.
        sigma: f64,
    },
    /// The current command failed; why.
    Failed(String),
    /// The operator wants to hold before the next motion.
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
        /// How many times the points that are configured a surface voxel needs.
        factor: usize,
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
    /// Combine all `scans` scans.
    Filter {
        /// Number of scans.
        scans: usize,
    },
    /// Make the mesh.
    Reconstruct,
    /// Wait until the operator resumes.
    Hold,
    /// The end.
    End(Outcome),
}

/// How a session ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// With a mesh; why no more scans were taken.
    Modelled(String),
    /// Without a mesh, in the given phase; why.
    Failed(Phase, String),
    /// The operator ended it.
    Cancelled,
}
