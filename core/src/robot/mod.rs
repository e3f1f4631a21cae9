//! Robot model: kinematics, reachability, collisions and paths.
//!
//! A viewpoint is a pose `object_from_sensor`. [`Workcell::reach`] answers whether the robot can take it: joint
//! vectors within the limits and free of collisions, a way there, and the sensor's sweep. Which of the two frames
//! moves, the object or the sensor, makes no difference to it.

mod chain;
mod collision;
#[cfg(test)]
mod coverage_tests;
mod description;
mod family;
mod inverse;
mod model;
mod motion;
mod path;
mod reach;
mod self_filter;
mod solids;
mod sweep;
#[cfg(test)]
mod tests;
mod timing;
mod tree;
mod urdf;
mod workcell;

pub use collision::Obstacle;
pub use description::{SETUPS, description, home};
pub use model::{Joint, JointKind, LinkShape, RobotModel};
pub(crate) use reach::HALF_SWEEP_STEPS;
pub use reach::{Hindrance, Reach, ReachRequest, Reached, slide_range};
pub use self_filter::BodyFilter;
pub use timing::Trajectory;
pub use workcell::Workcell;

/// The frame that is modelled in.
pub const OBJECT_FRAME: &str = "object";
/// The sensor's frame: z forward, x right, y down.
pub const SENSOR_FRAME: &str = "sensor_optical";
