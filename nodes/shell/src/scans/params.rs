//! Which points count, and how scans are registered.

use puffer_core::register::RegisterParams;
use puffer_core::scans::PoseSigma;

puffer_core::params! {
    /// Which points of a scan count, and what is known of the robot's poses.
    pub struct ScanParams("scan") {
        /// Frame that is modelled in.
        object_frame: String = "object".to_owned();
        /// Standard deviation of the robot's position per axis.
        pose_translation: f64 = 0.003, in [0.000001, 1.0], unit "m";
        /// Standard deviation of the robot's orientation per axis.
        pose_rotation: f64 = 0.01, in [0.000001, 1.0], unit "rad";
        /// Points this near to the robot, the gripper or the table are cut; needs robot_description.
        body_margin: f64 = 0.005, in [0.0, 0.1], unit "m";
        /// Whether points on the robot, the gripper and the table are cut at all.
        cut_bodies: bool = true;
        /// Points farther from the object frame's z axis are cut.
        radius: f64 = 0.2, in [0.01, 10.0], unit "m";
        /// Points higher above the object frame's origin are cut.
        height: f64 = 0.4, in [0.01, 10.0], unit "m";
        /// Points lower below the object frame's origin are cut.
        depth: f64 = 0.05, in [0.0, 10.0], unit "m";
        /// How long a scan waits for its transform, on the clock on the wall.
        tf_deadline: f64 = 5.0, in [0.1, 600.0], unit "s";
    }
}

impl ScanParams {
    /// What is known of the robot's poses.
    pub fn pose_sigma(&self) -> PoseSigma {
        PoseSigma { translation: self.pose_translation, rotation: self.pose_rotation }
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
