//! The joints between two frames as one serial chain, with the Jacobian of its end.

use super::model::{Motion, RobotModel};
use crate::geometry::{Pose, Twist, Vec3};

/// The way from one frame to another through the tree. Positions are those of [`Chain::joints`], in that order,
/// and two more for the freedom of a view: the slide along the end frame's z (metres), and the roll about it
/// (radians).
#[derive(Clone, Debug)]
pub(crate) struct Chain {
    links: Vec<ChainLink>,
    last: Pose,
    /// The robot's joints that move the end, ascending.
    pub joints: Vec<usize>,
}

#[derive(Clone, Debug)]
struct ChainLink {
    before: Pose,
    /// `joint` is the place in [`Chain::joints`].
    motion: Motion,
}

impl Chain {
    /// The chain from link `base` to link `end` of the robot.
    pub(crate) fn new(robot: &RobotModel, base: usize, end: usize) -> Chain {
        let (mut up, mut down) = (to_root(robot, base), to_root(robot, end));
        while up.last().is_some() && up.last() == down.last() {
            up.pop();
            down.pop();
        }
        let mut links: Vec<ChainLink> = Vec::new();
        let mut before = Pose::identity();
        for &index in &up {
            let edge = &robot.edges[index];
            if let Some(motion) = edge.motion {
                // Going against the edge: its displacement is undone.
                let motion = Motion { factor: -motion.factor, offset: -motion.offset, ..motion };
                links.push(ChainLink { before, motion });
                before = Pose::identity();
            }
            before *= edge.parent_from_joint.inverse();
        }
        for &index in down.iter().rev() {
            let edge = &robot.edges[index];
            before *= edge.parent_from_joint;
            if let Some(motion) = edge.motion {
                links.push(ChainLink { before, motion });
                before = Pose::identity();
            }
        }
        let mut joints: Vec<usize> = links.iter().map(|l| l.motion.joint).collect();
        joints.sort_unstable();
        joints.dedup();
        for link in &mut links {
            link.motion.joint = joints.partition_point(|&j| j < link.motion.joint);
        }
        Chain { links, last: before, joints }
    }

    /// Number of positions: the joints, slide and roll.
    pub(crate) fn len(&self) -> usize {
        self.joints.len() + 2
    }

    /// Pose `base_from_end` for the first of the positions; slide and roll are left out.
    pub(crate) fn pose(&self, x: &[f64]) -> Pose {
        let mut pose = Pose::identity();
        for link in &self.links {
            pose = pose * link.before * link.motion.displacement(x[link.motion.joint]);
        }
        pose * self.last
    }

    /// The view `base_from_view` that the end takes: the end frame, moved forth by `-slide` and turned by `-roll`
    /// about its z. `columns[i]` becomes the view's twist (right perturbation) per unit of position `i`.
    pub(crate) fn view(&self, x: &[f64], columns: &mut Vec<Twist>) -> Pose {
        let count = self.joints.len();
        columns.clear();
        columns.resize(count + 2, Twist::zeros());
        let mut axes: Vec<(usize, bool, Vec3, Vec3)> = Vec::with_capacity(self.links.len());
        let mut pose = Pose::identity();
        for link in &self.links {
            pose *= link.before;
            let axis = pose.rotation * link.motion.axis.into_inner() * link.motion.factor;
            let at = pose.translation.vector;
            axes.push((link.motion.joint, link.motion.slides, axis, at));
            pose *= link.motion.displacement(x[link.motion.joint]);
        }
        let view = pose * self.last * slide_and_roll(x[count], x[count + 1]).inverse();
        let (origin, to_view) = (view.translation.vector, view.rotation.inverse());
        for (joint, slides, axis, at) in axes {
            let moves = if slides { axis } else { axis.cross(&(origin - at)) };
            let turns = if slides { Vec3::zeros() } else { axis };
            let (moves, turns) = (to_view * moves, to_view * turns);
            columns[joint] += Twist::new(moves.x, moves.y, moves.z, turns.x, turns.y, turns.z);
        }
        columns[count] = Twist::new(0.0, 0.0, -1.0, 0.0, 0.0, 0.0);
        columns[count + 1] = Twist::new(0.0, 0.0, 0.0, 0.0, 0.0, -1.0);
        view
    }
}

/// `view_from_sensor`: the sensor slid along its z and rolled about it.
pub(crate) fn slide_and_roll(slide: f64, roll: f64) -> Pose {
    Pose::from_parts(
        nalgebra::Translation3::new(0.0, 0.0, slide),
        nalgebra::UnitQuaternion::from_axis_angle(&Vec3::z_axis(), roll),
    )
}

/// Edges from a link up to the root.
fn to_root(robot: &RobotModel, link: usize) -> Vec<usize> {
    let mut edges = Vec::new();
    let mut at = robot.above[link];
    while let Some(edge) = at {
        edges.push(edge);
        at = robot.above[robot.edges[edge].parent];
    }
    edges
}
