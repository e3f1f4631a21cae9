//! The joints between two frames as one serial kinematic chain, with the Jacobian of its end.

use super::model::{JointMotion, RobotModel};
use crate::geometry::{Pose, Twist, Vec3};

/// The chain of joints from one frame of the robot to another.
///
/// Chain positions are those of [`KinematicChain::joints`], in that order, followed by the two
/// degrees of freedom that a view has: the slide along the z axis of the end frame (metres) and the
/// roll about it (radians).
#[derive(Clone, Debug)]
pub(crate) struct KinematicChain {
    segments: Vec<ChainSegment>,
    /// The fixed transform from behind the last joint to the end frame.
    tip: Pose,
    /// The robot's joints that move the end, ascending.
    pub joints: Vec<usize>,
}

/// A joint and the fixed transform in front of it.
#[derive(Clone, Debug)]
struct ChainSegment {
    /// Pose of the joint in the frame behind the previous joint.
    origin: Pose,
    /// Its `joint` is an index into [`KinematicChain::joints`], not into the robot's joints.
    motion: JointMotion,
}

/// Where and about which axis a position of the chain moves its end; base frame.
struct JointAxis {
    /// Index of the chain position.
    joint: usize,
    is_prismatic: bool,
    /// Direction, times the multiplier of the joint.
    axis: Vec3,
    /// A point on the axis, metres.
    point: Vec3,
}

impl KinematicChain {
    /// The chain from link `base` to link `end` of the robot.
    pub(crate) fn new(robot: &RobotModel, base: usize, end: usize) -> KinematicChain {
        let (mut up, mut down) = (robot.edges_to_root(base), robot.edges_to_root(end));
        // Edges above the common ancestor do not belong to the chain.
        while up.last().is_some() && up.last() == down.last() {
            up.pop();
            down.pop();
        }
        let mut segments: Vec<ChainSegment> = Vec::new();
        let mut origin = Pose::identity();
        for &index in &up {
            let edge = &robot.edges[index];
            if let Some(motion) = edge.motion {
                // This edge is passed from child to parent, so its displacement is inverted.
                let motion = JointMotion {
                    multiplier: -motion.multiplier,
                    offset: -motion.offset,
                    ..motion
                };
                segments.push(ChainSegment { origin, motion });
                origin = Pose::identity();
            }
            origin *= edge.parent_from_joint.inverse();
        }
        for &index in down.iter().rev() {
            let edge = &robot.edges[index];
            origin *= edge.parent_from_joint;
            if let Some(motion) = edge.motion {
                segments.push(ChainSegment { origin, motion });
                origin = Pose::identity();
            }
        }
        let mut joints: Vec<usize> = segments.iter().map(|s| s.motion.joint).collect();
        joints.sort_unstable();
        joints.dedup();
        for segment in &mut segments {
            segment.motion.joint = joints.partition_point(|&j| j < segment.motion.joint);
        }
        KinematicChain { segments, tip: origin, joints }
    }

    /// Number of chain positions: the joints, slide and roll.
    pub(crate) fn len(&self) -> usize {
        self.joints.len() + 2
    }

    /// The chain's joint positions out of the robot's joint positions `q`.
    pub(crate) fn joint_positions(&self, q: &[f64]) -> Vec<f64> {
        self.joints.iter().map(|&joint| q[joint]).collect()
    }

    /// The pose `base_from_end` for the joint positions at the front of `x`; slide and roll do not
    /// matter.
    pub(crate) fn end_pose(&self, x: &[f64]) -> Pose {
        let mut pose = Pose::identity();
        for segment in &self.segments {
            pose = pose * segment.origin * segment.motion.displacement(x[segment.motion.joint]);
        }
        pose * self.tip
    }

    /// The view `base_from_view` that the end takes: the end frame, moved by `-slide` along its z
    /// axis and turned by `-roll` about it.
    ///
    /// `jacobian` becomes the geometric Jacobian in the view's frame: its column `i` is the twist
    /// of the view (right perturbation) per unit of position `i`.
    pub(crate) fn view_with_jacobian(&self, x: &[f64], jacobian: &mut Vec<Twist>) -> Pose {
        let count = self.joints.len();
        jacobian.clear();
        jacobian.resize(count + 2, Twist::zeros());
        let mut axes: Vec<JointAxis> = Vec::with_capacity(self.segments.len());
        let mut pose = Pose::identity();
        for ChainSegment { origin, motion } in &self.segments {
            pose *= origin;
            axes.push(JointAxis {
                joint: motion.joint,
                is_prismatic: motion.is_prismatic,
                axis: pose.rotation * motion.axis.into_inner() * motion.multiplier,
                point: pose.translation.vector,
            });
            pose *= motion.displacement(x[motion.joint]);
        }
        let view = pose * self.tip * view_from_sensor(x[count], x[count + 1]).inverse();
        let (position, view_from_base) = (view.translation.vector, view.rotation.inverse());
        for JointAxis { joint, is_prismatic, axis, point } in axes {
            let linear = if is_prismatic { axis } else { axis.cross(&(position - point)) };
            let angular = if is_prismatic { Vec3::zeros() } else { axis };
            let (linear, angular) = (view_from_base * linear, view_from_base * angular);
            jacobian[joint] +=
                Twist::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z);
        }
        jacobian[count] = Twist::new(0.0, 0.0, -1.0, 0.0, 0.0, 0.0);
        jacobian[count + 1] = Twist::new(0.0, 0.0, 0.0, 0.0, 0.0, -1.0);
        view
    }
}

/// The pose of a sensor that is moved from the viewpoint by `slide` metres along the viewing axis z
/// and rolled about it by `roll` radians.
pub(crate) fn view_from_sensor(slide: f64, roll: f64) -> Pose {
    Pose::from_parts(
        nalgebra::Translation3::new(0.0, 0.0, slide),
        nalgebra::UnitQuaternion::from_axis_angle(&Vec3::z_axis(), roll),
    )
}

#[cfg(test)]
mod tests {
    use super::super::planar_arm_tests::{chain, planar_arm, robot};
    use super::*;
    use crate::geometry::log;

    #[test]
    fn the_end_of_a_planar_arm_is_where_trigonometry_puts_it() {
        let chain = chain(&planar_arm());
        assert_eq!((chain.joints.as_slice(), chain.len()), ([0, 1].as_slice(), 4));
        for (a, b) in [(0.0f64, 0.0f64), (0.3, 0.5), (-1.2, 2.1), (2.9, -0.4)] {
            let pose = chain.end_pose(&[a, b]);
            let expected = Vec3::new(
                0.4 * a.cos() + 0.3 * (a + b).cos(),
                0.4 * a.sin() + 0.3 * (a + b).sin(),
                0.0,
            );
            assert!((pose.translation.vector - expected).norm() < 1e-12);
            let axis = Vec3::new((a + b).cos(), (a + b).sin(), 0.0);
            assert!((pose.rotation * Vec3::z() - axis).norm() < 1e-12);
        }
    }

    #[test]
    fn the_jacobian_of_a_planar_arm_has_the_textbook_columns() {
        let chain = chain(&planar_arm());
        let (a, b) = (0.4f64, 0.9f64);
        let mut jacobian = Vec::new();
        let view = chain.view_with_jacobian(&[a, b, 0.0, 0.0], &mut jacobian);
        // Velocity of the tip in the base frame per unit of each joint (Siciliano et al. 2009,
        // §3.2).
        let second = Vec3::new(-0.3 * (a + b).sin(), 0.3 * (a + b).cos(), 0.0);
        let first = second + Vec3::new(-0.4 * a.sin(), 0.4 * a.cos(), 0.0);
        for (column, expected) in jacobian.iter().zip([first, second]) {
            let linear = view.rotation * column.fixed_rows::<3>(0).into_owned();
            let angular = view.rotation * column.fixed_rows::<3>(3).into_owned();
            assert!((linear - expected).norm() < 1e-12, "{linear} {expected}");
            assert!((angular - Vec3::z()).norm() < 1e-12, "{angular}");
        }
    }

    #[test]
    fn a_chain_and_its_reverse_are_inverse_of_each_other() {
        // Both ends move: the object on a slide, the sensor on a turntable whose mimic turns it
        // back by half.
        let limit = "<limit lower='-1' upper='1' effort='1' velocity='1'/>";
        let robot = robot(&format!(
            "<link name='base'/><link name='object'/><link name='arm'/><link name='sensor_optical'/>\
             <joint name='slide' type='prismatic'><parent link='base'/><child link='object'/>\
             <origin xyz='0.1 0.2 0' rpy='0.3 0 0'/><axis xyz='0 1 0'/>{limit}</joint>\
             <joint name='turn' type='revolute'><parent link='base'/><child link='arm'/>\
             <origin xyz='0 0 0.5'/><axis xyz='0 0 1'/>{limit}</joint>\
             <joint name='back' type='revolute'><parent link='arm'/><child link='sensor_optical'/>\
             <origin xyz='0.4 0 0' rpy='0 0.7 0'/><axis xyz='0 0 1'/>\
             <mimic joint='turn' multiplier='-0.5' offset='0.1'/>{limit}</joint>"
        ));
        let [object, sensor] = ["object", "sensor_optical"].map(|name| robot.link(name).unwrap());
        let forward = KinematicChain::new(&robot, object, sensor);
        let backward = KinematicChain::new(&robot, sensor, object);
        assert_eq!(forward.joints, [0, 1]);
        for q in [[0.0, 0.0], [0.4, -0.8], [-0.9, 0.6]] {
            let x = forward.joint_positions(&q);
            let loop_closure = forward.end_pose(&x) * backward.end_pose(&x);
            assert!(log(&loop_closure).norm() < 1e-12);
            let expected = robot.pose(&q, "object", "sensor_optical").unwrap();
            assert!(log(&(forward.end_pose(&x).inverse() * expected)).norm() < 1e-12);
        }
    }

    #[test]
    fn slide_and_roll_undo_those_of_the_view() {
        let chain = chain(&planar_arm());
        let mut jacobian = Vec::new();
        let view = chain.view_with_jacobian(&[0.3, 0.5, 0.04, -1.1], &mut jacobian);
        let sensor = chain.end_pose(&[0.3, 0.5]);
        assert!(log(&(sensor.inverse() * view * view_from_sensor(0.04, -1.1))).norm() < 1e-12);
    }
}
