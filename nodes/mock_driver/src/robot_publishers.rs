//! What the driver publishes of the robot: description, transforms, joint positions and time.

use anyhow::Result;
use puffer_core::robot::RobotModel;
use puffer_msgs::rosgraph_msgs::msg::Clock;
use puffer_msgs::sensor_msgs::msg::JointState;
use puffer_msgs::std_msgs::msg::{Header, String as Text};
use puffer_ros::{Node, Publisher, QosProfile, Stamp, TfBroadcaster, Transform};

use crate::Params;

/// Publishers of the robot's state and of the clock.
pub(crate) struct RobotPublishers {
    clock: Publisher<Clock>,
    joints: Publisher<JointState>,
    description: Publisher<Text>,
    tf: TfBroadcaster,
}

impl RobotPublishers {
    pub(crate) fn new(node: &Node<Params>) -> Result<RobotPublishers> {
        Ok(RobotPublishers {
            clock: node.publisher("/clock", QosProfile::Standard)?,
            joints: node.publisher("joint_states", QosProfile::Standard)?,
            description: node.publisher("robot_description", QosProfile::Latched)?,
            tf: node.tf_broadcaster()?,
        })
    }

    /// Publishes what never changes: the description, and the transforms of the links that no joint
    /// moves.
    pub(crate) fn publish_static(&self, robot: &RobotModel, urdf: &str) -> Result<()> {
        self.description.publish(&Text { data: urdf.to_owned() })?;
        self.tf.send_static(&link_transforms(robot, &[], Stamp::ZERO, false))
    }

    /// Publishes the transforms of the links that joints move, at joint positions `q`.
    pub(crate) fn publish_transforms(
        &self,
        robot: &RobotModel,
        q: &[f64],
        stamp: Stamp,
    ) -> Result<()> {
        self.tf.send(&link_transforms(robot, q, stamp, true))
    }

    /// Publishes time, joint positions and the transforms of the links that joints move.
    pub(crate) fn publish_state(&self, robot: &RobotModel, q: &[f64], stamp: Stamp) -> Result<()> {
        self.publish_transforms(robot, q, stamp)?;
        self.joints.publish(&JointState {
            header: Header { stamp: stamp.into(), frame_id: String::new() },
            name: robot.joints().iter().map(|j| j.name.clone()).collect(),
            position: q.to_vec(),
            ..JointState::default()
        })?;
        // The clock comes last, so that a reader that acts on it finds the rest.
        self.clock.publish(&Clock { clock: stamp.into() })
    }
}

/// The transforms from parent to link of the links that joints move (`moving`), or of those that no
/// joint moves.
fn link_transforms(robot: &RobotModel, q: &[f64], stamp: Stamp, moving: bool) -> Vec<Transform> {
    let poses = robot.forward_kinematics(q);
    let names = robot.link_names();
    (0..names.len())
        .filter_map(|link| {
            let (parent, moves) = robot.parent_link(link)?;
            (moves == moving).then(|| Transform {
                parent: names[parent].clone(),
                child: names[link].clone(),
                stamp,
                pose: poses[parent].inverse() * poses[link],
            })
        })
        .collect()
}
