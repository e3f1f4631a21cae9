//! Parameters of the planner.

use crate::geometry::{Aabb, SensorModel, StereoModel, StriperModel, Vec3};
use crate::scan::Support;

crate::choice! {
    /// The sensor that scans are planned for.
    pub enum SensorChoice {
        /// Laser striper, swept by the arm.
        Striper = "striper",
        /// Stereo pair.
        Stereo = "stereo",
    }
}

crate::params! {
    /// What the planner knows of the robot cell.
    pub struct PlannerParams("planner") {
        /// The sensor that scans.
        sensor: SensorChoice = SensorChoice::Striper;
        /// What the object stands on. On a table no view from below the table is planned.
        support: Support = Support::None;
        /// Radius of the region of interest around the z axis of the object frame.
        radius: f64 = 0.15, in [0.01, 10.0], unit "m";
        /// Height of the region of interest above the origin of the object frame.
        height: f64 = 0.3, in [0.01, 10.0], unit "m";
        /// Depth of the region of interest below the origin of the object frame. The fixture that
        /// holds the object must lie in it.
        depth: f64 = 0.03, in [0.0, 10.0], unit "m";
        /// Largest difference between the distance from sensor to object and the working distance,
        /// as a share of the working distance.
        distance_share: f64 = 0.15, in [0.0, 0.9];
        /// Minimum clearance between bodies when the robot takes a view.
        margin: f64 = 0.01, in [0.0, 0.5], unit "m";
        /// How long a request for a plan waits for its scans, the joint states and the robot
        /// description, in wall-clock time.
        input_deadline: f64 = 30.0, in [0.1, 600.0], unit "s";
    }
}

impl PlannerParams {
    /// The region of interest, object frame, metres.
    pub fn region(&self) -> Aabb {
        Aabb {
            min: Vec3::new(-self.radius, -self.radius, -self.depth),
            max: Vec3::new(self.radius, self.radius, self.height),
        }
    }

    /// The model of the sensor.
    pub fn sensor(&self) -> SensorModel {
        match self.sensor {
            SensorChoice::Striper => SensorModel::Striper(StriperModel::SCANCONTROL),
            SensorChoice::Stereo => SensorModel::Stereo(StereoModel::GUPPY),
        }
    }
}
