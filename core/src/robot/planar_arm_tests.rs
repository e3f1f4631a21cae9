//! Small robots for tests, whose kinematics can be computed by hand.

use super::kinematic_chain::KinematicChain;
use super::model::RobotModel;

/// The robot of a URDF with these links and joints.
pub(super) fn robot(body: &str) -> RobotModel {
    RobotModel::from_urdf(&format!("<robot name='test'>{body}</robot>")).unwrap()
}

/// A planar arm: two links of 0.4 and 0.3 m in the xy plane, with joints about z at the base and
/// between them, and the sensor at the tip, which looks along x of the second link.
///
/// A ball of 0.05 m radius is at the tip, and one of 0.02 m in the middle of the first link.
pub(super) fn planar_arm() -> RobotModel {
    robot(&format!(
        "{}{}{}{}{}{}{}",
        "<link name='object'/>",
        "<link name='upper'><collision><origin xyz='0.2 0 0'/><geometry><sphere radius='0.02'/>\
         </geometry></collision></link>",
        "<link name='lower'/>",
        "<link name='sensor_optical'><collision><geometry><sphere radius='0.05'/></geometry>\
         </collision></link>",
        joint("shoulder", "object", "upper", "0 0 0"),
        joint("elbow", "upper", "lower", "0.4 0 0"),
        "<joint name='tip' type='fixed'><parent link='lower'/><child link='sensor_optical'/>\
         <origin xyz='0.3 0 0' rpy='0 1.5707963267948966 0'/></joint>",
    ))
}

fn joint(name: &str, parent: &str, child: &str, xyz: &str) -> String {
    format!(
        "<joint name='{name}' type='revolute'><parent link='{parent}'/><child link='{child}'/>\
         <origin xyz='{xyz}'/><axis xyz='0 0 1'/>\
         <limit lower='-3' upper='3' effort='1' velocity='2'/></joint>"
    )
}

/// The chain of a robot from the object to the sensor.
pub(super) fn chain(robot: &RobotModel) -> KinematicChain {
    let [object, sensor] = ["object", "sensor_optical"].map(|name| robot.link(name).unwrap());
    KinematicChain::new(robot, object, sensor)
}
