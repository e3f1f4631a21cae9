//! A robot as a tree of links, with its forward kinematics.

use crate::geometry::{Pose, Shape, Vec3};
use crate::{Error, Result};
use nalgebra::{Translation3, Unit, UnitQuaternion};

/// A position that rounding has put this far beyond a limit is still within it, radians or metres.
const LIMIT_TOLERANCE: f64 = 1e-9;

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Turns between limits, radians.
    Revolute,
    /// Turns without limits, radians.
    Continuous,
    /// Slides between limits, metres.
    Prismatic,
}

/// A joint that can be commanded: neither fixed nor following another one.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Its name in the description.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Lowest and highest position, radians or metres; infinite for a continuous joint.
    pub limits: [f64; 2],
    /// Highest speed, radians or metres a second.
    pub velocity: f64,
}

impl Joint {
    fn is_beyond_limits(&self, position: f64) -> bool {
        let [low, high] = self.limits;
        position < low - LIMIT_TOLERANCE || position > high + LIMIT_TOLERANCE
    }
}

/// A collision body.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkShape {
    /// Index of the link in [`RobotModel::link_names`].
    pub link: usize,
    /// The body.
    pub shape: Shape,
    /// Its pose in the frame of the link.
    pub link_from_shape: Pose,
}

/// A checked robot description. Build one with [`RobotModel::from_urdf`].
#[derive(Clone, Debug)]
pub struct RobotModel {
    pub(super) name: String,
    pub(super) joints: Vec<Joint>,
    pub(super) link_names: Vec<String>,
    pub(super) shapes: Vec<LinkShape>,
    /// Parents before children.
    pub(super) edges: Vec<Edge>,
    /// The edge to the parent of each link; none for the root.
    pub(super) parent_edge: Vec<Option<usize>>,
}

/// A joint of any kind between two links.
#[derive(Clone, Debug)]
pub(super) struct Edge {
    pub parent: usize,
    pub child: usize,
    pub parent_from_joint: Pose,
    pub motion: Option<JointMotion>,
}

/// How an edge follows a joint: its position is `multiplier * q[joint] + offset`, as for a mimic
/// joint of URDF; for any other joint the multiplier is 1 and the offset 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct JointMotion {
    pub axis: Unit<Vec3>,
    pub is_prismatic: bool,
    pub joint: usize,
    pub multiplier: f64,
    pub offset: f64,
}

impl JointMotion {
    /// The pose behind the joint in the frame in front of it, for the position `q` of the joint
    /// that it follows, radians or metres.
    pub(super) fn displacement(&self, q: f64) -> Pose {
        let position = self.multiplier * q + self.offset;
        if self.is_prismatic {
            Pose::from_parts(
                Translation3::from(self.axis.into_inner() * position),
                UnitQuaternion::identity(),
            )
        } else {
            let turn = UnitQuaternion::from_axis_angle(&self.axis, position);
            Pose::from_parts(Translation3::identity(), turn)
        }
    }
}

impl RobotModel {
    /// Name of the robot.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The joints that can be commanded, in the order of the description. Joint positions are in
    /// this order everywhere.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Names of the links, in the order of the description.
    pub fn link_names(&self) -> &[String] {
        &self.link_names
    }

    /// The collision bodies, in the order of the description.
    pub fn link_shapes(&self) -> &[LinkShape] {
        &self.shapes
    }

    /// Index of a link.
    ///
    /// # Errors
    /// [`Error::Input`] if there is no link of that name.
    pub fn link(&self, name: &str) -> Result<usize> {
        self.link_names.iter().position(|n| n == name).ok_or_else(|| {
            Error::input(format!("the robot `{}` has no frame (link) `{name}`", self.name))
        })
    }

    /// Checks joint positions: their number, and that all are finite.
    ///
    /// # Errors
    /// [`Error::Input`] that names the joint.
    pub fn check_configuration(&self, q: &[f64]) -> Result<()> {
        if q.len() != self.joints.len() {
            return Err(Error::input(format!(
                "{} joint positions given, but the robot `{}` has {} joints",
                q.len(),
                self.name,
                self.joints.len()
            )));
        }
        match self.joints.iter().zip(q).find(|(_, q)| !q.is_finite()) {
            Some((joint, q)) => {
                Err(Error::input(format!("the position of joint `{}` is {q}", joint.name)))
            }
            None => Ok(()),
        }
    }

    /// The first joint whose position lies outside its limits.
    pub fn joint_beyond_limits(&self, q: &[f64]) -> Option<&Joint> {
        self.joints.iter().zip(q).find(|(joint, q)| joint.is_beyond_limits(**q)).map(|(j, _)| j)
    }

    /// Forward kinematics: the pose `root_from_link` of every link, in the order of
    /// [`RobotModel::link_names`]. A joint for which `q` is too short is at 0.
    pub fn forward_kinematics(&self, q: &[f64]) -> Vec<Pose> {
        let mut poses = vec![Pose::identity(); self.link_names.len()];
        for edge in &self.edges {
            let mut pose = poses[edge.parent] * edge.parent_from_joint;
            if let Some(motion) = &edge.motion {
                pose *= motion.displacement(q.get(motion.joint).copied().unwrap_or(0.0));
            }
            poses[edge.child] = pose;
        }
        poses
    }

    /// The pose `a_from_b` of link `b` in the frame of link `a`.
    ///
    /// # Errors
    /// [`Error::Input`] if there is no such link or `q` does not fit the joints.
    pub fn pose(&self, q: &[f64], a: &str, b: &str) -> Result<Pose> {
        self.check_configuration(q)?;
        let (a, b) = (self.link(a)?, self.link(b)?);
        let poses = self.forward_kinematics(q);
        Ok(poses[a].inverse() * poses[b])
    }

    /// Time that the slowest joint needs from the joint positions `a` to `b` at full speed,
    /// seconds.
    pub fn min_travel_time(&self, a: &[f64], b: &[f64]) -> f64 {
        self.joints
            .iter()
            .zip(a)
            .zip(b)
            .map(|((joint, a), b)| (a - b).abs() / joint.velocity)
            .fold(0.0, f64::max)
    }
}
