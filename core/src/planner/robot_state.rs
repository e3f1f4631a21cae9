//! The robot and its joint positions.

use super::request::{JointPositions, PlanRequest};
use crate::robot::{RobotModel, Workcell};
use crate::{Error, Result};

/// A joint within this distance of where it was sent (radians or metres) has arrived: more than the
/// noise of encoders, less than the tolerance at which controllers report a goal as reached.
const JOINT_TOLERANCE: f64 = 0.01;

/// The robot of the newest description, and its joint positions.
#[derive(Default)]
pub(super) struct RobotState {
    description: String,
    /// What is wrong with the newest description.
    error: Option<String>,
    workcell: Option<Workcell>,
    joints: Option<Vec<f64>>,
}

impl RobotState {
    /// Whether this description is the newest one already.
    pub(super) fn has_description(&self, urdf: &str) -> bool {
        self.description == urdf
    }

    /// Takes a new description (URDF). The old robot and its joint positions are forgotten, even
    /// if the new description cannot be used.
    ///
    /// # Errors
    /// [`Error::Input`] with what is wrong with the description.
    pub(super) fn load(&mut self, urdf: &str) -> Result<()> {
        self.description = urdf.to_owned();
        (self.workcell, self.joints, self.error) = (None, None, None);
        match RobotModel::from_urdf(urdf).and_then(Workcell::new) {
            Ok(workcell) => {
                self.workcell = Some(workcell);
                Ok(())
            }
            Err(error) => {
                let text = format!("robot_description: {error}");
                self.error = Some(text.clone());
                Err(Error::input(text))
            }
        }
    }

    /// What is wrong with the newest description.
    pub(super) fn error(&self) -> Option<&str> {
        self.error.as_deref()
    }

    /// The robot and its collision model.
    pub(super) fn workcell(&self) -> Option<&Workcell> {
        self.workcell.as_ref()
    }

    /// The newest joint positions, in the order of the robot's joints.
    pub(super) fn joints(&self) -> Option<&[f64]> {
        self.joints.as_deref()
    }

    /// Names of the robot's joints; empty without a robot.
    pub(super) fn joint_names(&self) -> Vec<String> {
        let joints = self.workcell.as_ref().map_or(&[][..], |w| w.robot().joints());
        joints.iter().map(|joint| joint.name.clone()).collect()
    }

    /// Takes joint positions, and says whether they hold all joints of the robot. Joints that the
    /// robot does not have are ignored.
    pub(super) fn set_joints(&mut self, positions: &JointPositions) -> bool {
        let joints = self.joint_vector(positions);
        let complete = joints.is_some();
        if complete {
            self.joints = joints;
        }
        complete
    }

    /// Whether all joints are within [`JOINT_TOLERANCE`] of `goal`.
    pub(super) fn is_at(&self, goal: &JointPositions) -> bool {
        self.joint_vector(goal).zip(self.joints.as_ref()).is_some_and(|(goal, joints)| {
            goal.iter().zip(joints).all(|(a, b)| (a - b).abs() <= JOINT_TOLERANCE)
        })
    }

    /// The joint positions from which a requested motion starts.
    ///
    /// # Errors
    /// [`Error::Input`] if the start of the request misses joints, or no joint positions are known.
    pub(super) fn start(&self, request: &PlanRequest) -> Result<Vec<f64>> {
        if let Some(start) = &request.start {
            return self
                .joint_vector(start)
                .ok_or_else(|| Error::input("start does not name all joints of the robot"));
        }
        // Joint states arrive at any time and are noisy; the goal of the last motion is the same in
        // each run.
        let sent_to = request.sent_to.as_ref().filter(|goal| self.is_at(goal));
        sent_to
            .and_then(|goal| self.joint_vector(goal))
            .or_else(|| self.joints.clone())
            .ok_or_else(|| Error::input("no joint states"))
    }

    /// What is missing of the robot, in words.
    pub(super) fn missing(&self) -> Option<String> {
        if self.workcell.is_none() {
            return Some(
                "no robot_description came: start the driver or robot_state_publisher".to_owned(),
            );
        }
        let unknown = self.joints.is_none();
        unknown.then(|| "no joint_states for all joints of the robot came".to_owned())
    }

    /// The positions in the order of the robot's joints; `None` without a robot, or if one of its
    /// joints is not named or its position is not finite.
    fn joint_vector(&self, positions: &JointPositions) -> Option<Vec<f64>> {
        let joints = self.workcell.as_ref()?.robot().joints();
        joints.iter().map(|joint| position_of(&joint.name, positions)).collect()
    }
}

fn position_of(name: &str, positions: &JointPositions) -> Option<f64> {
    let index = positions.names.iter().position(|n| n == name)?;
    positions.positions.get(index).copied().filter(|v| v.is_finite())
}
