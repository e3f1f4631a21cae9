//! Inputs and outputs of the planner.

use crate::geometry::{Aabb, Pose, Scan};
use crate::register::Status;
use crate::robot::ViewMotion;
use crate::view::Plan;

/// A version of a scan: a scan gets a new version each time its pose or its verdict changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScanVersion {
    /// Number of the scan.
    pub id: u32,
    /// Version of the scan.
    pub version: u32,
}

/// A registered scan, or a newer version of one.
#[derive(Clone, Debug)]
pub struct ScanUpdate {
    /// Number and version of the scan.
    pub version: ScanVersion,
    /// The measured points, sensor frame, metres.
    pub scan: Scan,
    /// Returns of the same scan from robot, table or background, sensor frame, metres. They show
    /// that the space before them is free.
    pub beyond: Scan,
    /// The pose `object_from_sensor` that the robot reported.
    pub prior: Pose,
    /// The registered pose `object_from_sensor`.
    pub pose: Pose,
    /// Whether the scan was accepted.
    pub status: Status,
    /// Name of the object frame that the scan is registered in.
    pub frame: String,
}

/// The corrected pose of a scan.
#[derive(Clone, Copy, Debug)]
pub struct PoseUpdate {
    /// The scan, and the version of it that the pose was computed from.
    pub version: ScanVersion,
    /// The corrected pose `object_from_sensor`.
    pub pose: Pose,
    /// Whether the scan is accepted at that pose.
    pub status: Status,
}

/// Positions of named joints, radians or metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointPositions {
    /// Names of the joints.
    pub names: Vec<String>,
    /// The position of each joint.
    pub positions: Vec<f64>,
}

/// A request for the next view, with all inputs that the plan is to rest on.
#[derive(Clone, Debug)]
pub struct PlanRequest {
    /// Number of scans that must have arrived.
    pub scans: usize,
    /// Revision of the corrected poses that must have arrived; 0 for none.
    pub revision: u32,
    /// Scans that must have arrived in at least these versions.
    pub required: Vec<ScanVersion>,
    /// Numbers of the scans that the plan rests on, ascending; `None` for all accepted ones.
    pub members: Option<Vec<u32>>,
    /// The region of interest, object frame, metres.
    pub region: Aabb,
    /// Measured points that a surface voxel needs, as a multiple of the configured number.
    pub point_factor: usize,
    /// Where the motion starts; `None` for where the robot is.
    pub start: Option<JointPositions>,
    /// Where the robot was sent last.
    pub sent_to: Option<JointPositions>,
}

/// Whether the inputs of a request have arrived.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Readiness {
    /// All inputs have arrived.
    Ready,
    /// Scans or corrected poses are missing; the text says which.
    ScansMissing(String),
    /// The robot description or joint positions are missing; the text says which.
    RobotMissing(String),
    /// The robot description cannot be used. Waiting does not help.
    RobotUnusable(String),
}

/// The answer to a request.
#[derive(Clone, Debug)]
pub struct PlanningResult {
    /// The next view and what was considered.
    pub plan: Plan,
    /// How the robot takes the chosen view; `None` if none was chosen.
    pub motion: Option<ViewMotion>,
    /// Edge of a voxel, metres.
    pub voxel_edge: f64,
}
