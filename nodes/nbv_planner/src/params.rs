//! Parameters of the planner.

use puffer_core::geometry::{Aabb, SensorModel, StereoModel, StriperModel, Vec3};
use puffer_core::scans::Support;
use puffer_core::view::ViewParams;

puffer_core::choice! {
    /// A sensor.
    pub enum SensorChoice {
        /// Laser striper, swept by the arm.
        Striper = "striper",
        /// Stereo pair.
        Stereo = "stereo",
    }
}

puffer_core::params! {
    /// What the planner knows of the cell.
    pub struct PlannerParams("planner") {
        /// The sensor that scans.
        sensor: SensorChoice = SensorChoice::Striper;
        /// What the object stands on: nothing is looked for below a table.
        support: Support = Support::None;
        /// Radius of the region of interest round the object frame's z axis.
        radius: f64 = 0.15, in [0.01, 10.0], unit "m";
        /// Height of the region of interest above the object frame's origin.
        height: f64 = 0.3, in [0.01, 10.0], unit "m";
        /// Depth of the region of interest below the object frame's origin: what holds the object must be in it.
        depth: f64 = 0.03, in [0.0, 10.0], unit "m";
        /// How far the distance from sensor to object may differ from the working distance, as a share of it.
        distance_share: f64 = 0.15, in [0.0, 0.9];
        /// Air kept between bodies.
        margin: f64 = 0.01, in [0.0, 0.5], unit "m";
        /// How long a request waits for scans, joint states and robot description, on the clock on the wall.
        input_deadline: f64 = 30.0, in [0.1, 600.0], unit "s";
    }
}

impl PlannerParams {
    /// The region of interest, object frame.
    pub(crate) fn region(&self) -> Aabb {
        Aabb {
            min: Vec3::new(-self.radius, -self.radius, -self.depth),
            max: Vec3::new(self.radius, self.radius, self.height),
        }
    }

    /// The sensor's model.
    pub(crate) fn sensor(&self) -> SensorModel {
        match self.sensor {
            SensorChoice::Striper => SensorModel::Striper(StriperModel::SCANCONTROL),
            SensorChoice::Stereo => SensorModel::Stereo(StereoModel::GUPPY),
        }
    }
}

puffer_core::param_groups! {
    /// All parameters of the planner.
    pub struct Params {
        /// What it knows of the cell.
        planner: PlannerParams,
        /// How views are chosen.
        view: ViewParams,
    }
}
