//! Which points count, and how scans are registered.

use puffer_core::intake::{CutParams, IntakeParams, Region};
use puffer_core::register::RegisterParams;
use puffer_core::scan::PoseSigma;

puffer_core::params! {
    /// Which points of a scan count, and what is known of the robot's poses.
    pub struct ScanParams("scan") {
        /// Name of the frame that the object is modelled in.
        object_frame: String = "object".to_owned();
        /// Standard deviation of the sensor's position, as the robot reports it, per axis.
        pose_translation: f64 = 0.003, in [0.000001, 1.0], unit "m";
        /// Standard deviation of the sensor's orientation, as the robot reports it, per axis.
        pose_rotation: f64 = 0.01, in [0.000001, 1.0], unit "rad";
        /// Points of a scan that are nearer than this to the robot, the gripper or the table are
        /// cut; needs robot_description.
        body_margin: f64 = 0.005, in [0.0, 0.1], unit "m";
        /// Whether points of a scan on the robot, the gripper and the table are cut at all.
        cut_bodies: bool = true;
        /// Points of a scan that are farther from the object frame's z axis than this are cut.
        radius: f64 = 0.2, in [0.01, 10.0], unit "m";
        /// Points of a scan that are higher above the object frame's origin than this are cut.
        height: f64 = 0.4, in [0.01, 10.0], unit "m";
        /// Points of a scan that are lower below the object frame's origin than this are cut.
        depth: f64 = 0.05, in [0.0, 10.0], unit "m";
        /// How long a scan waits for its transform before it is refused, in wall time.
        tf_deadline: f64 = 5.0, in [0.1, 600.0], unit "s";
    }
}

impl ScanParams {
    /// The standard deviation of the robot's poses.
    pub fn pose_sigma(&self) -> PoseSigma {
        PoseSigma { translation: self.pose_translation, rotation: self.pose_rotation }
    }

    /// The region that the object lies within.
    pub fn region(&self) -> Region {
        Region { radius: self.radius, height: self.height, depth: self.depth }
    }
}

puffer_core::param_groups! {
    /// All parameters of the registrar.
    pub struct RegistrarParams {
        /// Which points count.
        scan: ScanParams,
        /// How scans are registered.
        register: RegisterParams,
    }
}

impl RegistrarParams {
    /// These parameters as the intake of scans in core takes them.
    pub fn intake(&self) -> IntakeParams {
        let cut = CutParams {
            region: self.scan.region(),
            body_margin: self.scan.body_margin,
            pose_sigma: self.scan.pose_sigma(),
        };
        IntakeParams { cut, register: self.register.clone() }
    }
}
