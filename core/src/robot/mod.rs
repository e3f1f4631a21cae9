//! Robot model: kinematics, reachability, collisions and motion planning.
//!
//! A viewpoint is a pose `object_from_sensor`. [`Workcell::check_reachability`] answers whether the
//! robot can take it: joint positions within the limits and free of collisions, a path that leads
//! there, and the sensor's sweep. Whether the object or the sensor is carried by the arm makes no
//! difference to it.
//!
//! ```
//! use puffer_core::geometry::Vec3;
//! use puffer_core::robot::{Obstacle, RobotModel, Workcell, home_configuration, setup_urdf};
//!
//! let slider = RobotModel::from_urdf(
//!     "<robot name='slider'><link name='object'/><link name='sensor_optical'/>\
//!      <joint name='slide' type='prismatic'><parent link='object'/><child link='sensor_optical'/>\
//!      <axis xyz='0 0 1'/><limit lower='0' upper='1' velocity='0.5' effort='1'/></joint></robot>",
//! )?;
//! let poses = slider.forward_kinematics(&[0.3]);
//! assert_eq!(poses[slider.link("sensor_optical")?].translation.vector, Vec3::new(0.0, 0.0, 0.3));
//!
//! // A robot that is built in: in its rest position, nothing is closer than 1 cm.
//! let cell = Workcell::new(RobotModel::from_urdf(setup_urdf("kr16_laser")?)?)?;
//! let home = home_configuration("kr16_laser")?;
//! assert_eq!(cell.find_obstruction(&home, &Obstacle::empty(), 0.01)?, None);
//! # Ok::<(), puffer_core::Error>(())
//! ```

mod body_filter;
mod collision;
#[cfg(test)]
mod coverage_tests;
mod frames;
mod inverse_kinematics;
mod kinematic_chain;
mod kinematic_tree;
mod link_meshes;
mod model;
#[cfg(test)]
mod planar_arm_tests;
mod planning_space;
mod reachability;
mod rrt_connect;
mod setups;
mod sweep;
#[cfg(test)]
mod tests;
mod trajectory;
mod urdf;
mod view_solutions;
mod workcell;

pub use body_filter::BodyFilter;
pub use collision::Obstacle;
pub use frames::{OBJECT_FRAME, SENSOR_FRAME};
pub use model::{Joint, JointKind, LinkShape, RobotModel};
pub use reachability::{
    Reachability, ReachabilityRequest, UnreachableCause, ViewMotion, slide_range,
};
pub use setups::{SETUP_NAMES, home_configuration, setup_urdf};
pub(crate) use sweep::HALF_SWEEP_STEPS;
pub use trajectory::Trajectory;
pub use workcell::Workcell;
