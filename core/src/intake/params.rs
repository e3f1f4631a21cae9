//! What decides which points of a scan count as the object's.

use crate::geometry::Vec3;
use crate::register::RegisterParams;
use crate::scan::PoseSigma;

/// The parameters of the intake of scans.
#[derive(Clone, Debug)]
pub struct IntakeParams {
    /// Which points count as the object's.
    pub cut: CutParams,
    /// How scans are registered.
    pub register: RegisterParams,
}

/// Which points of a scan count as the object's.
#[derive(Clone, Copy, Debug)]
pub struct CutParams {
    /// Where the object may be.
    pub region: Region,
    /// Points as near as this to a body are cut, metres.
    pub body_margin: f64,
    /// Standard deviations of the robot's poses.
    pub pose_sigma: PoseSigma,
}

/// A cylinder about the z axis of the object frame that the object lies within.
#[derive(Clone, Copy, Debug)]
pub struct Region {
    /// Largest distance from the axis, metres.
    pub radius: f64,
    /// Largest height above the origin, metres.
    pub height: f64,
    /// Largest depth below the origin, metres.
    pub depth: f64,
}

impl Region {
    /// Whether a point (object frame, metres) lies within; the boundary does.
    pub fn contains(&self, point: &Vec3) -> bool {
        point.xy().norm() <= self.radius && (-self.depth..=self.height).contains(&point.z)
    }
}
