//! A robot as a tree of links: poses of all of them for given joint positions.

use crate::geometry::{Pose, Shape, Vec3};
use crate::{Error, Result};
use nalgebra::{Translation3, Unit, UnitQuaternion};

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

/// A collision body.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkShape {
    /// Index of the link in [`RobotModel::link_names`].
    pub link: usize,
    /// The body.
    pub shape: Shape,
    /// Its place.
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
    /// The edge above each link; none above the root.
    pub(super) above: Vec<Option<usize>>,
}

/// A joint of any kind between two links.
#[derive(Clone, Debug)]
pub(super) struct Edge {
    pub parent: usize,
    pub child: usize,
    pub parent_from_joint: Pose,
    pub motion: Option<Motion>,
}

/// How an edge follows a joint: its position is `factor * q[joint] + offset`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    pub axis: Unit<Vec3>,
    pub slides: bool,
    pub joint: usize,
    pub factor: f64,
    pub offset: f64,
}

impl Motion {
    /// The displacement for the position `q` of the joint that it follows.
    pub(super) fn displacement(&self, q: f64) -> Pose {
        let at = self.factor * q + self.offset;
        if self.slides {
            Pose::from_parts(
                Translation3::from(self.axis.into_inner() * at),
                UnitQuaternion::identity(),
            )
        } else {
            let turn = UnitQuaternion::from_axis_angle(&self.axis, at);
            Pose::from_parts(Translation3::identity(), turn)
        }
    }
}

impl RobotModel {
    /// Name of the robot.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The joints that can be commanded, in the order of the description. Joint vectors have this order.
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

    /// Checks a joint vector: its length, and that all numbers are finite.
    ///
    /// # Errors
    /// [`Error::Input`] that names the joint.
    pub fn check(&self, q: &[f64]) -> Result<()> {
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
    pub fn beyond_limits(&self, q: &[f64]) -> Option<&Joint> {
        let outside = |joint: &Joint, q: f64| {
            q < joint.limits[0] - LIMIT_SLACK || q > joint.limits[1] + LIMIT_SLACK
        };
        self.joints.iter().zip(q).find(|(joint, q)| outside(joint, **q)).map(|(joint, _)| joint)
    }

    /// Pose `root_from_link` of every link, in the order of [`RobotModel::link_names`]. A joint that `q` has no
    /// number for counts as 0.
    pub fn forward(&self, q: &[f64]) -> Vec<Pose> {
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

    /// The transform `a_from_b` between two links.
    ///
    /// # Errors
    /// [`Error::Input`] if there is no such link or `q` does not fit the joints.
    pub fn pose(&self, q: &[f64], a: &str, b: &str) -> Result<Pose> {
        self.check(q)?;
        let (a, b) = (self.link(a)?, self.link(b)?);
        let poses = self.forward(q);
        Ok(poses[a].inverse() * poses[b])
    }

    /// Time that the slowest joint needs from `a` to `b` at full speed, seconds.
    pub fn joint_time(&self, a: &[f64], b: &[f64]) -> f64 {
        let time = |((joint, a), b): ((&Joint, &f64), &f64)| (a - b).abs() / joint.velocity;
        self.joints.iter().zip(a).zip(b).map(time).fold(0.0, f64::max)
    }
}

/// A position that rounding has put this far beyond a limit is still within, radians or metres.
const LIMIT_SLACK: f64 = 1e-9;
