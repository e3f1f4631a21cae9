//! A robot of one's own is loaded from URDF, and asked where its sensor is and which views it can
//! take.
//!
//! `cargo run --release -p puffer_core --example 4_a_robot_of_your_own [ROBOT.urdf]`
//!
//! Any robot will do whose URDF has the links `object` (the frame that is modelled in) and
//! `sensor_optical` (z forward, x right, y down). Which of the two the robot moves, or both, makes
//! no difference. The robot below carries the object on a turntable and the sensor on a gantry.

use puffer_core::geometry::{Aabb, Pose, Vec3};
use puffer_core::robot::{
    Joint, JointKind, Obstacle, Reachability, ReachabilityRequest, RobotModel, Workcell,
};
use puffer_core::{Error, Result};
use std::path::Path;

const GANTRY: &str = r#"
<robot name="gantry">
  <link name="world"/>
  <link name="object">
    <collision><origin xyz="0 0 -0.02"/><geometry><cylinder radius="0.1" length="0.02"/></geometry></collision>
  </link>
  <joint name="turntable" type="continuous">
    <parent link="world"/><child link="object"/><axis xyz="0 0 1"/>
    <limit velocity="1" effort="1"/>
  </joint>
  <link name="carriage"/>
  <joint name="forward" type="prismatic">
    <parent link="world"/><child link="carriage"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="1" velocity="0.2" effort="1"/>
  </joint>
  <link name="slide"/>
  <joint name="upward" type="prismatic">
    <parent link="carriage"/><child link="slide"/><axis xyz="0 0 1"/>
    <limit lower="0.05" upper="0.8" velocity="0.2" effort="1"/>
  </joint>
  <link name="head">
    <collision><origin xyz="0.05 0 0"/><geometry><box size="0.08 0.1 0.05"/></geometry></collision>
  </link>
  <joint name="tilt" type="revolute">
    <parent link="slide"/><child link="head"/><axis xyz="0 -1 0"/>
    <limit lower="-0.3" upper="1.6" velocity="1" effort="1"/>
  </joint>
  <link name="sensor_optical"/>
  <joint name="mount" type="fixed">
    <parent link="head"/><child link="sensor_optical"/>
    <origin rpy="0 -1.5707963 0"/>
  </joint>
</robot>"#;

fn main() -> Result<()> {
    let text = match std::env::args().nth(1) {
        Some(path) => std::fs::read_to_string(&path)
            .map_err(|error| Error::io("read", Path::new(&path), error))?,
        None => GANTRY.to_owned(),
    };
    let cell = Workcell::new(RobotModel::from_urdf(&text)?)?;
    let robot = cell.robot();
    println!("{}: {} joints", robot.name(), robot.joints().len());

    let start: Vec<f64> = robot.joints().iter().map(middle).collect();
    for (joint, position) in robot.joints().iter().zip(&start) {
        println!("  {} ({:?}) at {position:.2}", joint.name, joint.kind);
    }
    println!("sensor in the object frame: {}", describe(&cell.object_from_sensor(&start)?));

    // The object fills a box of 10 cm on the turntable.
    let obstacle = Obstacle::from_box(&Aabb {
        min: Vec3::new(-0.05, -0.05, 0.0),
        max: Vec3::new(0.05, 0.05, 0.1),
    });
    for eye in [Vec3::new(0.3, 0.2, 0.3), Vec3::new(-0.2, 0.1, 0.5), Vec3::new(0.2, 0.0, -0.3)] {
        let request = ReachabilityRequest {
            view: look_at(&eye, &Vec3::new(0.0, 0.0, 0.05)),
            start: &start,
            sweep: 0.0,
            slide: [0.0, 0.0],
            obstacle: &obstacle,
            margin: 0.01,
        };
        match cell.check_reachability(&request)? {
            Reachability::Reachable(motion) => {
                println!("from {}: reached in {:.1} s", describe(&request.view), motion.duration);
                println!("  joints {:.2?}", motion.q);
            }
            Reachability::Unreachable { cause, reason } => {
                println!("from {}: {} ({reason})", describe(&request.view), cause.describe());
            }
        }
    }
    Ok(())
}

/// The middle of a joint's limits; 0 of a joint without.
fn middle(joint: &Joint) -> f64 {
    match joint.kind {
        JointKind::Continuous => 0.0,
        _ => (joint.limits[0] + joint.limits[1]) / 2.0,
    }
}

/// The pose `object_from_sensor` of a sensor at `eye` that looks at `target`.
fn look_at(eye: &Vec3, target: &Vec3) -> Pose {
    // The sensor's z axis faces the target; the roll about it is free.
    Pose::face_towards(&(*eye).into(), &(*target).into(), &Vec3::z())
}

/// The position of a pose.
fn describe(pose: &Pose) -> String {
    let p = pose.translation.vector;
    format!("({:.2}, {:.2}, {:.2}) m", p.x, p.y, p.z)
}
