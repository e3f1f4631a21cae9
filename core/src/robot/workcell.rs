//! A robot between the two frames of a viewpoint, prepared for planning.

use super::collision::{CollisionChecker, Obstacle};
use super::frames::{OBJECT_FRAME, SENSOR_FRAME};
use super::kinematic_chain::KinematicChain;
use super::model::RobotModel;
use super::planning_space::PlanningSpace;
use super::rrt_connect::sampling_range;
use super::sweep;
use super::trajectory::Trajectory;
use super::view_solutions::SeedSet;
use crate::geometry::Pose;
use crate::{Error, Result};

/// Number of configurations that seeds of the inverse kinematics are taken from.
const SEED_SAMPLES: usize = 6000;
/// Seeds must have at least this clearance, metres.
const MIN_SEED_CLEARANCE: f64 = 1e-3;
/// Bases of the Halton sequence: one prime for each joint.
const HALTON_BASES: [usize; 16] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53];

/// A robot that brings the frames [`OBJECT_FRAME`] and [`SENSOR_FRAME`] to a viewpoint.
#[derive(Clone, Debug)]
pub struct Workcell {
    pub(super) robot: RobotModel,
    /// The chain from the object to the sensor.
    pub(super) chain: KinematicChain,
    pub(super) collisions: CollisionChecker,
    pub(super) seeds: SeedSet,
}

impl Workcell {
    /// Prepares a robot; takes some tenths of a second.
    ///
    /// # Errors
    /// [`Error::Input`] if one of the frames is missing, or if no joint (or more than 16) moves one
    /// against the other.
    pub fn new(robot: RobotModel) -> Result<Workcell> {
        let (object, sensor) = (robot.link(OBJECT_FRAME)?, robot.link(SENSOR_FRAME)?);
        let chain = KinematicChain::new(&robot, object, sensor);
        if chain.joints.is_empty() || chain.joints.len() > HALTON_BASES.len() {
            return Err(Error::input(format!(
                "{} joints of `{}` move `{SENSOR_FRAME}` against `{OBJECT_FRAME}`; 1 to {} are supported",
                chain.joints.len(),
                robot.name(),
                HALTON_BASES.len()
            )));
        }
        let samples: Vec<Vec<f64>> =
            (0..SEED_SAMPLES).map(|i| halton_configuration(&robot, &chain, i + 1)).collect();
        let collisions = CollisionChecker::new(&robot, &chain, object, &samples);
        let mut free = samples;
        free.retain(|q| {
            let poses = robot.forward_kinematics(q);
            collisions.clearance(&poses, MIN_SEED_CLEARANCE).pair.is_none()
        });
        let seeds = SeedSet::new(&chain, &free);
        Ok(Workcell { robot, chain, collisions, seeds })
    }

    /// The robot.
    pub fn robot(&self) -> &RobotModel {
        &self.robot
    }

    /// The pose `object_from_sensor` at the joint positions `q`.
    ///
    /// # Errors
    /// As [`RobotModel::check_configuration`].
    pub fn object_from_sensor(&self, q: &[f64]) -> Result<Pose> {
        self.robot.pose(q, OBJECT_FRAME, SENSOR_FRAME)
    }

    /// What keeps the robot from the joint positions `q`, as a text: a joint beyond its limits, or
    /// two bodies closer than `margin` metres. `None` if nothing does.
    ///
    /// # Errors
    /// As [`RobotModel::check_configuration`].
    pub fn find_obstruction(
        &self,
        q: &[f64],
        obstacle: &Obstacle,
        margin: f64,
    ) -> Result<Option<String>> {
        self.robot.check_configuration(q)?;
        if let Some(joint) = self.robot.joint_beyond_limits(q) {
            return Ok(Some(format!("the joint `{}` is beyond its limits", joint.name)));
        }
        let collisions = self.collisions.with_obstacle(&self.robot, &self.chain, obstacle);
        let space = self.planning_space(&collisions, margin);
        Ok(space.collision_at(q).map(|pair| {
            format!("{} are {:.1} mm apart", space.describe_pair(&pair), pair.distance * 1e3)
        }))
    }

    /// The motion that moves the sensor by `length` metres along its own y axis at constant
    /// orientation, with the joint positions `q` in the middle, in `2 * half_steps` steps; or a
    /// text that says why there is none. `margin` is the minimum clearance between bodies, metres.
    ///
    /// # Errors
    /// As [`RobotModel::check_configuration`].
    pub fn plan_sweep(
        &self,
        q: &[f64],
        length: f64,
        half_steps: usize,
        obstacle: &Obstacle,
        margin: f64,
    ) -> Result<std::result::Result<Trajectory, String>> {
        self.robot.check_configuration(q)?;
        let collisions = self.collisions.with_obstacle(&self.robot, &self.chain, obstacle);
        let space = self.planning_space(&collisions, margin);
        Ok(sweep::plan_sweep(&space, &self.chain, q, length, half_steps))
    }

    pub(super) fn planning_space<'a>(
        &'a self,
        collisions: &'a CollisionChecker,
        margin: f64,
    ) -> PlanningSpace<'a> {
        PlanningSpace { robot: &self.robot, collisions, active_joints: &self.chain.joints, margin }
    }
}

/// The joint positions that the `index`-th point of the Halton sequence (Halton 1960) has within
/// the limits. Joints that do not move the sensor against the object are in the middle of their
/// limits.
fn halton_configuration(robot: &RobotModel, chain: &KinematicChain, index: usize) -> Vec<f64> {
    let ranges: Vec<[f64; 2]> = robot.joints.iter().map(|j| sampling_range(j.limits)).collect();
    let mut q: Vec<f64> = ranges.iter().map(|[low, high]| (low + high) / 2.0).collect();
    for (&joint, &base) in chain.joints.iter().zip(&HALTON_BASES) {
        let [low, high] = ranges[joint];
        q[joint] = low + (high - low) * radical_inverse(index, base);
    }
    q
}

/// The number below 1 whose digits behind the point are the digits of `index` in reverse order.
fn radical_inverse(mut index: usize, base: usize) -> f64 {
    let (mut value, mut digit) = (0.0, 1.0 / base as f64);
    while index > 0 {
        value += (index % base) as f64 * digit;
        index /= base;
        digit /= base as f64;
    }
    value
}

#[cfg(test)]
mod tests {
    use super::super::planar_arm_tests::{chain, planar_arm};
    use super::*;

    #[test]
    fn radical_inverses_are_those_of_the_van_der_corput_sequence() {
        let base_2: Vec<f64> = (1..8).map(|i| radical_inverse(i, 2)).collect();
        assert_eq!(base_2, [0.5, 0.25, 0.75, 0.125, 0.625, 0.375, 0.875]);
        for (index, expected) in [(1, 1.0 / 3.0), (2, 2.0 / 3.0), (3, 1.0 / 9.0), (5, 7.0 / 9.0)] {
            assert!((radical_inverse(index, 3) - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn halton_configurations_fill_the_limits_evenly() {
        let robot = planar_arm();
        let chain = chain(&robot);
        let mut counts = [[0; 6]; 6];
        for index in 1..=3600 {
            let q = halton_configuration(&robot, &chain, index);
            assert_eq!(robot.joint_beyond_limits(&q), None);
            counts[(q[0] + 3.0) as usize][(q[1] + 3.0) as usize] += 1;
        }
        for count in counts.as_flattened() {
            assert!((90..=110).contains(count), "{counts:?}");
        }
    }

    #[test]
    fn robots_without_joints_between_the_frames_are_refused() {
        let robot = super::super::planar_arm_tests::robot(
            "<link name='object'/><link name='sensor_optical'/>\
             <joint name='j' type='fixed'><parent link='object'/><child link='sensor_optical'/></joint>",
        );
        let error = Workcell::new(robot).unwrap_err().to_string();
        assert!(error.contains("0 joints of `test`"), "{error}");
    }
}
