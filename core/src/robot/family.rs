//! The family of joint vectors that reach a view: roll and slide free, from many seeds.

use super::chain::{Chain, slide_and_roll};
use super::inverse::{Bounds, solve};
use super::model::RobotModel;
use super::path::sampled_range;
use crate::geometry::{Pose, Vec3};
use std::f64::consts::{PI, TAU};

/// Iterations of a search from a seed, which stands far from the solution.
const FAR: usize = 40;
/// Iterations from one solution to its neighbour in roll.
const NEAR: usize = 8;
/// Step in roll, radians.
const ROLL_STEP: f64 = PI / 12.0;
/// A radian off counts as much as so many metres when seeds are chosen.
const METRES_PER_RADIAN: f64 = 0.3;
/// How unwillingly the slide moves: a metre of it costs as much as three radians.
const SLIDE_WEIGHT: f64 = 0.1;

/// Configurations spread over the joint limits, with the views that they take.
#[derive(Clone, Debug)]
pub(crate) struct Seeds {
    entries: Vec<Seed>,
}

#[derive(Clone, Debug)]
struct Seed {
    /// Positions of the chain's joints.
    x: Vec<f64>,
    /// Place and viewing axis of the sensor in the object frame.
    position: Vec3,
    axis: Vec3,
}

impl Seeds {
    /// Of the joint vectors `samples`.
    pub(crate) fn new(chain: &Chain, samples: &[Vec<f64>]) -> Seeds {
        let entry = |q: &Vec<f64>| {
            let x: Vec<f64> = chain.joints.iter().map(|&j| q[j]).collect();
            let pose = chain.pose(&x);
            Seed { x, position: pose.translation.vector, axis: pose.rotation * Vec3::z() }
        };
        Seeds { entries: samples.iter().map(entry).collect() }
    }

    /// The `count` seeds nearest to the view, nearest first.
    fn nearest(&self, view: &Pose, count: usize) -> Vec<&Seed> {
        let (position, axis) = (view.translation.vector, view.rotation * Vec3::z());
        let cost = |seed: &Seed| {
            // 1 - cos is half the square of a small angle.
            let turn = 2.0 * (1.0 - seed.axis.dot(&axis));
            (seed.position - position).norm_squared() + METRES_PER_RADIAN.powi(2) * turn
        };
        let mut order: Vec<(f64, usize)> =
            self.entries.iter().enumerate().map(|(i, seed)| (cost(seed), i)).collect();
        let by_cost = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if count < order.len() {
            order.select_nth_unstable_by(count, by_cost);
            order.truncate(count);
        }
        order.sort_by(by_cost);
        order.iter().map(|&(_, i)| &self.entries[i]).collect()
    }
}

/// A joint vector that reaches the view, slid and rolled.
#[derive(Clone, Debug)]
pub(crate) struct Member {
    pub q: Vec<f64>,
    /// `object_from_sensor`.
    pub pose: Pose,
    /// From the start, seconds of the slowest joint at full speed.
    pub time: f64,
}

/// How far the family is searched.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    pub seeds: usize,
    /// Lowest and highest slide, metres.
    pub slide: [f64; 2],
}

/// Members of the family of `view`, those first that `start` reaches soonest.
pub(crate) fn family(
    robot: &RobotModel,
    chain: &Chain,
    seeds: &Seeds,
    view: &Pose,
    start: &[f64],
    extent: Extent,
) -> Vec<Member> {
    let own: Vec<f64> = chain.joints.iter().map(|&j| start[j]).collect();
    let chosen = seeds.nearest(view, extent.seeds);
    let mut bounds = bounds(robot, chain, extent.slide);
    let roll_place = chain.len() - 1;
    let mut found: Vec<Vec<f64>> = Vec::new();
    for x in std::iter::once(&own).chain(chosen.iter().map(|s| &s.x)) {
        let slide = 0f64.clamp(extent.slide[0], extent.slide[1]);
        let roll = nearest_roll(view, &chain.pose(x));
        let seed: Vec<f64> = x.iter().copied().chain([slide, roll]).collect();
        bounds.weights[roll_place] = 1.0;
        let Some(solution) = solve(chain, view, &seed, &bounds, FAR) else { continue };
        if found.iter().any(|other| similar(other, &solution)) {
            continue;
        }
        bounds.weights[roll_place] = 0.0;
        for direction in [1.0, -1.0] {
            let mut at = solution.clone();
            for _ in 0..12 {
                at[roll_place] += direction * ROLL_STEP;
                match solve(chain, view, &at, &bounds, NEAR) {
                    Some(next) => at = next,
                    None => break,
                }
                found.push(at.clone());
            }
        }
        found.push(solution);
    }
    let mut members: Vec<Member> = found
        .iter()
        .flat_map(|x| turned(robot, chain, x, start))
        .map(|(q, x)| {
            let pose = view * slide_and_roll(x[roll_place - 1], x[roll_place]);
            Member { time: robot.joint_time(start, &q), q, pose }
        })
        .collect();
    members.sort_by(|a, b| a.time.total_cmp(&b.time));
    members
}

fn bounds(robot: &RobotModel, chain: &Chain, slide: [f64; 2]) -> Bounds {
    let mut limits: Vec<[f64; 2]> = chain.joints.iter().map(|&j| robot.joints[j].limits).collect();
    let mut weights = vec![1.0; limits.len()];
    limits.extend([slide, [f64::NEG_INFINITY, f64::INFINITY]]);
    weights.extend([if slide[0] < slide[1] { SLIDE_WEIGHT } else { 0.0 }, 1.0]);
    Bounds { limits, weights }
}

/// The roll that brings the view closest to the sensor's pose.
fn nearest_roll(view: &Pose, sensor: &Pose) -> f64 {
    let turn = (view.rotation.inverse() * sensor.rotation).to_rotation_matrix();
    (turn[(1, 0)] - turn[(0, 1)]).atan2(turn[(0, 0)] + turn[(1, 1)])
}

fn similar(a: &[f64], b: &[f64]) -> bool {
    let off = |(a, b): (&f64, &f64)| ((a - b + PI).rem_euclid(TAU) - PI).abs();
    a.iter().zip(b).map(off).fold(0.0, f64::max) < 0.1
}

/// The joint vectors of `x` with every joint that may turn a full round more or less put where the start reaches it
/// soonest, and those where one of these joints is put elsewhere.
fn turned(
    robot: &RobotModel,
    chain: &Chain,
    x: &[f64],
    start: &[f64],
) -> Vec<(Vec<f64>, Vec<f64>)> {
    let mut nearest = start.to_vec();
    let mut others = Vec::new();
    for (&joint, &value) in chain.joints.iter().zip(x) {
        let turns = robot.joints[joint].kind != super::JointKind::Prismatic;
        let mut rounds =
            if turns { rounds(value, robot.joints[joint].limits) } else { vec![value] };
        rounds.sort_by(|a, b| (a - start[joint]).abs().total_cmp(&(b - start[joint]).abs()));
        nearest[joint] = rounds.first().copied().unwrap_or(value);
        others.extend(rounds.iter().skip(1).take(1).map(|&other| (joint, other)));
    }
    let mut all = vec![(nearest.clone(), x.to_vec())];
    for (joint, other) in others {
        let mut q = nearest.clone();
        q[joint] = other;
        all.push((q, x.to_vec()));
    }
    all
}

/// The angles equal to `value` within the limits, or within a round of it if there are none.
fn rounds(value: f64, limits: [f64; 2]) -> Vec<f64> {
    let [low, high] = sampled_range(limits);
    let first = ((low - value) / TAU).ceil() as i64;
    let last = ((high - value) / TAU).floor() as i64;
    (first..=last).map(|turn| value + turn as f64 * TAU).collect()
}
