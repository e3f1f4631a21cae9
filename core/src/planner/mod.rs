//! The next view of a robot cell: everything that planning a view rests on, without messages.
//!
//! [`Planner`] keeps the registered scans, the space that they show, the robot and its joint
//! positions. [`Planner::readiness`] says whether the inputs of a request have arrived, and
//! [`Planner::plan`] answers it: the best view that the robot can take, and the motion to it. A
//! plan depends on what the request names, not on what else has arrived, or in which order.
//!
//! ```
//! use puffer_core::planner::{JointPositions, PlanRequest, Planner, PlannerParams, Readiness};
//! use puffer_core::robot::{home_configuration, setup_urdf};
//! use puffer_core::view::ViewParams;
//!
//! let params = PlannerParams::default();
//! let request = PlanRequest {
//!     scans: 0,
//!     revision: 0,
//!     required: Vec::new(),
//!     members: None,
//!     region: params.region(),
//!     point_factor: 1,
//!     start: None,
//!     sent_to: None,
//! };
//! let mut planner = Planner::new(params, ViewParams::default())?;
//! assert!(matches!(planner.readiness(&request), Readiness::RobotMissing(_)));
//! planner.on_robot_description(setup_urdf("kr16_laser")?)?;
//! let positions = home_configuration("kr16_laser")?;
//! planner.on_joint_state(&JointPositions { names: planner.joint_names(), positions });
//! assert_eq!(planner.readiness(&request), Readiness::Ready);
//! let result = planner.plan(&request)?;
//! assert!(result.plan.chosen.is_some() && result.motion.is_some());
//! # Ok::<(), puffer_core::Error>(())
//! ```

mod known_bodies;
mod params;

mod reach_query;
mod request;
mod robot_state;
mod scan_store;
mod view_planner;

pub use known_bodies::Target;
pub use params::{PlannerParams, SensorChoice};

pub use request::{
    JointPositions, PlanRequest, PlanningResult, PoseUpdate, Readiness, ScanUpdate, ScanVersion,
};
pub use view_planner::Planner;
