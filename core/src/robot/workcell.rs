//! A robot with the two frames of a viewpoint, ready for questions.

use super::chain::Chain;
use super::collision::{Collisions, Obstacle};
use super::family::Seeds;
use super::model::RobotModel;
use super::motion::Space;
use super::path::sampled_range;
use super::timing::Trajectory;
use super::{OBJECT_FRAME, SENSOR_FRAME, sweep};
use crate::geometry::Pose;
use crate::{Error, Result};

/// Configurations that searches start from.
const SEEDS: usize = 6000;
/// Bases of the Halton sequence.
const PRIMES: [usize; 16] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53];

/// A robot that brings the frames [`OBJECT_FRAME`] and [`SENSOR_FRAME`] to a viewpoint.
#[derive(Clone, Debug)]
pub struct Workcell {
    pub(super) robot: RobotModel,
    pub(super) chain: Chain,
    pub(super) collisions: Collisions,
    pub(super) seeds: Seeds,
}

impl Workcell {
    /// Prepares a robot; takes some tenths of a second.
    ///
    /// # Errors
    /// [`Error::Input`] if one of the frames is missing, or no joint (or more than 16) moves one against the other.
    pub fn new(robot: RobotModel) -> Result<Workcell> {
        let (object, sensor) = (robot.link(OBJECT_FRAME)?, robot.link(SENSOR_FRAME)?);
        let chain = Chain::new(&robot, object, sensor);
        if chain.joints.is_empty() || chain.joints.len() > PRIMES.len() {
            return Err(Error::input(format!(
                "{} joints of `{}` move `{SENSOR_FRAME}` against `{OBJECT_FRAME}`; 1 to {} are supported",
                chain.joints.len(),
                robot.name(),
                PRIMES.len()
            )));
        }
        let samples: Vec<Vec<f64>> = (0..SEEDS).map(|i| spread(&robot, &chain, i + 1)).collect();
        let collisions = Collisions::new(&robot, &chain, object, &samples);
        let free: Vec<Vec<f64>> = samples
            .into_iter()
            .filter(|q| collisions.clearance(&robot.forward(q), 1e-3).pair.is_none())
            .collect();
        let seeds = Seeds::new(&chain, &free);
        Ok(Workcell { robot, chain, collisions, seeds })
    }

    /// The robot.
    pub fn robot(&self) -> &RobotModel {
        &self.robot
    }

    /// The pose `object_from_sensor` at `q`.
    ///
    /// # Errors
    /// As [`RobotModel::check`].
    pub fn object_from_sensor(&self, q: &[f64]) -> Result<Pose> {
        self.robot.pose(q, OBJECT_FRAME, SENSOR_FRAME)
    }

    /// What keeps the robot from standing at `q` with `margin` metres of air, in words; none if it can.
    ///
    /// # Errors
    /// As [`RobotModel::check`].
    pub fn obstructed(
        &self,
        q: &[f64],
        obstacle: &Obstacle,
        margin: f64,
    ) -> Result<Option<String>> {
        self.robot.check(q)?;
        if let Some(joint) = self.robot.beyond_limits(q) {
            return Ok(Some(format!("the joint `{}` is beyond its limits", joint.name)));
        }
        let collisions = self.collisions.with(&self.robot, &self.chain, obstacle);
        let space = self.space(&collisions, margin);
        Ok(space.too_close(q).map(|pair| {
            format!("{} are {:.1} mm apart", space.describe(&pair), pair.distance * 1e3)
        }))
    }

    /// The joints' way that moves the sensor by `length` metres along its own y at constant orientation, `q` in the
    /// middle, in `2 * half_steps` steps; the text says why there is none.
    ///
    /// # Errors
    /// As [`RobotModel::check`].
    pub fn sweep_path(
        &self,
        q: &[f64],
        length: f64,
        half_steps: usize,
        obstacle: &Obstacle,
        margin: f64,
    ) -> Result<std::result::Result<Trajectory, String>> {
        self.robot.check(q)?;
        let collisions = self.collisions.with(&self.robot, &self.chain, obstacle);
        Ok(sweep::swept(&self.space(&collisions, margin), &self.chain, q, length, half_steps))
    }

    pub(super) fn space<'a>(&'a self, collisions: &'a Collisions, margin: f64) -> Space<'a> {
        Space { robot: &self.robot, collisions, moving: &self.chain.joints, margin }
    }
}

/// The `index`-th joint vector of a low-discrepancy sequence (Halton 1960) within the limits; joints that do not
/// move the sensor against the object stand in the middle of theirs.
fn spread(robot: &RobotModel, chain: &Chain, index: usize) -> Vec<f64> {
    let ranges: Vec<[f64; 2]> = robot.joints.iter().map(|j| sampled_range(j.limits)).collect();
    let mut q: Vec<f64> = ranges.iter().map(|[low, high]| (low + high) / 2.0).collect();
    for (&joint, &prime) in chain.joints.iter().zip(&PRIMES) {
        let [low, high] = ranges[joint];
        q[joint] = low + (high - low) * radical_inverse(index, prime);
    }
    q
}

/// The digits of `index` behind the point, in reverse.
fn radical_inverse(mut index: usize, base: usize) -> f64 {
    let (mut value, mut digit) = (0.0, 1.0 / base as f64);
    while index > 0 {
        value += (index % base) as f64 * digit;
        index /= base;
        digit /= base as f64;
    }
    value
}
