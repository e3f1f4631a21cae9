//! What the driver publishes of the robot.

use anyhow::Result;
use puffer_core::robot::RobotModel;
use puffer_msgs::rosgraph_msgs::msg::Clock;
use puffer_msgs::sensor_msgs::msg::JointState;
use puffer_msgs::std_msgs::msg::{Header, String as Text};
use puffer_shell::{Node, Profile, Publisher, Stamp, TfBroadcaster, Transform};

use crate::Params;

/// The topics of the robot and the clock.
pub(crate) struct Outputs {
    clock: Publisher<Clock>,
    joints: Publisher<JointState>,
    description: Publisher<Text>,
    tf: TfBroadcaster,
}

impl Outputs {
    pub(crate) fn new(node: &Node<Params>) -> Result<Outputs> {
        Ok(Outputs {
            clock: node.publisher("/clock", Profile::Standard)?,
            joints: node.publisher("joint_states", Profile::Standard)?,
            description: node.publisher("robot_description", Profile::Latched)?,
            tf: node.tf_broadcaster()?,
        })
    }

    /// Publishes what never changes: the description, and the links that no joint moves.
    pub(crate) fn start(&self, robot: &RobotModel, urdf: &str) -> Result<()> {
        self.description.publish(&Text { data: urdf.to_owned() })?;
        self.tf.send_static(&transforms(robot, &[], Stamp::ZERO, false))
    }

    /// Publishes once more where the links were that joints move.
    pub(crate) fn pose(&self, robot: &RobotModel, q: &[f64], stamp: Stamp) -> Result<()> {
        self.tf.send(&transforms(robot, q, stamp, true))
    }

    /// Publishes time and joint positions, and the links that joints move.
    pub(crate) fn tick(&self, robot: &RobotModel, q: &[f64], stamp: Stamp) -> Result<()> {
        let (sec, nanosec) = stamp.parts();
        let time = puffer_msgs::builtin_interfaces::msg::Time { sec, nanosec };
        self.tf.send(&transforms(robot, q, stamp, true))?;
        self.joints.publish(&JointState {
            header: Header { stamp: time, frame_id: String::new() },
            name: robot.joints().iter().map(|j| j.name.clone()).collect(),
            position: q.to_vec(),
            ..JointState::default()
        })?;
        // The clock comes last: who acts on it finds the rest.
        self.clock.publish(&Clock { clock: time })
    }
}

/// The transforms of the links that joints move, or of those that none does.
fn transforms(robot: &RobotModel, q: &[f64], stamp: Stamp, moving: bool) -> Vec<Transform> {
    let poses = robot.forward(q);
    let names = robot.link_names();
    (0..names.len())
        .filter_map(|link| {
            let (parent, moves) = robot.carrier(link)?;
            (moves == moving).then(|| Transform {
                parent: names[parent].clone(),
                child: names[link].clone(),
                stamp,
                pose: poses[parent].inverse() * poses[link],
            })
        })
        .collect()
}
