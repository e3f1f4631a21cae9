//! Whether a view can be taken, and how.

use super::collision::Obstacle;
use super::family::{Extent, Member, family};
use super::motion::Space;
use super::timing::{Trajectory, parametrised};
use super::workcell::Workcell;
use super::{path, sweep};
use crate::Result;
use crate::geometry::{Pose, SensorModel};

/// A view to be taken.
#[derive(Clone, Copy, Debug)]
pub struct ReachRequest<'a> {
    /// The viewpoint `object_from_sensor`; its roll about the viewing axis is free.
    pub view: Pose,
    /// Where the robot stands: a position for each joint.
    pub start: &'a [f64],
    /// Length of the sensor's sweep along its y about the viewpoint, metres; 0 for none.
    pub sweep: f64,
    /// How far the sensor may stand before the viewpoint along its viewing axis, lowest (negative: back) and highest
    /// (positive: closer), metres; see [`slide_range`].
    pub slide: [f64; 2],
    /// What is known of the object's extent.
    pub obstacle: &'a Obstacle,
    /// Air between bodies, metres. On the way half of it will do.
    pub margin: f64,
}

/// The answer.
#[derive(Clone, Debug, PartialEq)]
pub enum Reach {
    /// The view can be taken.
    Reached(Box<Reached>),
    /// It cannot: the whole family (roll, distance, ways of bending the arm) was tried.
    Refused {
        /// What the members of the family that came farthest failed at.
        hindrance: Hindrance,
        /// Why, in words.
        reason: String,
    },
}

/// What keeps the robot from a view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hindrance {
    /// The robot stands in a collision already.
    Start,
    /// No joint positions within the limits take the view.
    Limits,
    /// Those that take it collide.
    Collision,
    /// From those that stand free, the sensor cannot sweep.
    Sweep,
    /// To those that stand free, no free way was found.
    Way,
}

impl Hindrance {
    /// Said of a view.
    pub fn words(self) -> &'static str {
        match self {
            Hindrance::Start => "not asked, since the robot stands in a collision",
            Hindrance::Limits => "out of reach",
            Hindrance::Collision => "in collision",
            Hindrance::Sweep => "without room for the sweep",
            Hindrance::Way => "without a free way",
        }
    }
}

/// How a view is taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Reached {
    /// Joint positions at the viewpoint.
    pub q: Vec<f64>,
    /// The viewpoint with roll and distance as chosen.
    pub object_from_sensor: Pose,
    /// The way from the start to `q`.
    pub path: Trajectory,
    /// The sweep about `q`, if one was asked for.
    pub sweep: Option<Trajectory>,
    /// Time of path and sweep, seconds.
    pub duration: f64,
}

/// The slide that keeps the object's middle between `1 - share` and `1 + share` of the working distance and within
/// the sensor's range.
pub fn slide_range(sensor: &SensorModel, share: f64) -> [f64; 2] {
    let (distance, [near, far]) = (sensor.working_distance(), sensor.range());
    let back = (distance * share).min(far - distance).max(0.0);
    let forth = (distance * share).min(distance - near).max(0.0);
    [-back, forth]
}

/// Points of a sweep to either side of the middle: as many as the simulated driver sweeps with, so that what was found
/// possible is not refused there.
pub(crate) const HALF_SWEEP_STEPS: usize = 12;
/// Seeds of the first search, at the viewpoint itself, and of the second, with the slide free.
const SEEDS: [usize; 2] = [24, 96];
/// Configurations that one search for a way may end in, and how many searches are made.
const GOALS: usize = 10;
const BATCHES: usize = 4;
/// Samples of the search for a way.
const PATH_SAMPLES: usize = 1500;

/// Members of the family that failed, by what they failed at.
#[derive(Default)]
struct Failures {
    members: usize,
    colliding: usize,
    collision: String,
    sweeping: usize,
    sweep: String,
    paths: usize,
}

/// A member that holds everything but a way to it.
struct Candidate {
    member: Member,
    sweep: Option<Trajectory>,
}

impl Workcell {
    /// Whether and how the robot takes a view.
    ///
    /// # Errors
    /// As [`RobotModel::check`](super::RobotModel::check) of the start.
    pub fn reach(&self, request: &ReachRequest) -> Result<Reach> {
        self.robot.check(request.start)?;
        let collisions = self.collisions.with(&self.robot, &self.chain, request.obstacle);
        let space = self.space(&collisions, request.margin);
        if let Some(pair) = space.blocked(request.start, request.start) {
            return Ok(Reach::Refused {
                hindrance: Hindrance::Start,
                reason: format!(
                    "the robot stands in a collision: {} are {:.1} mm apart; move it by hand",
                    space.describe(&pair),
                    pair.distance * 1e3
                ),
            });
        }
        let mut failures = Failures::default();
        let [low, high] = request.slide;
        for (seeds, slide) in SEEDS.into_iter().zip([[0f64.clamp(low, high); 2], [low, high]]) {
            let extent = Extent { seeds, slide };
            let members =
                family(&self.robot, &self.chain, &self.seeds, &request.view, request.start, extent);
            if let Some(reached) = self.choose(&space, request, members, &mut failures) {
                return Ok(Reach::Reached(Box::new(reached)));
            }
        }
        Ok(Reach::Refused { hindrance: failures.hindrance(), reason: failures.reason() })
    }

    /// The first member that stands free, can sweep and has a straight way; else one of the first of them that a
    /// way round the obstacles leads to.
    fn choose(
        &self,
        space: &Space,
        request: &ReachRequest,
        members: Vec<Member>,
        failures: &mut Failures,
    ) -> Option<Reached> {
        let mut members = members.into_iter();
        for _ in 0..BATCHES {
            let mut waiting: Vec<Candidate> = Vec::new();
            for member in members.by_ref() {
                failures.members += 1;
                let Some(candidate) = self.candidate(space, request, member, failures) else {
                    continue;
                };
                if space.blocked(request.start, &candidate.member.q).is_none() {
                    let corners = [request.start.to_vec(), candidate.member.q.clone()];
                    return Some(self.reached(candidate, &corners));
                }
                waiting.push(candidate);
                if waiting.len() >= GOALS {
                    break;
                }
            }
            if waiting.is_empty() {
                return None;
            }
            failures.paths += waiting.len();
            let goals: Vec<Vec<f64>> = waiting.iter().map(|c| c.member.q.clone()).collect();
            if let Some(corners) = path::search(space, request.start, &goals, PATH_SAMPLES) {
                let end = corners.last()?;
                let candidate = waiting.into_iter().find(|c| c.member.q == *end)?;
                return Some(self.reached(candidate, &corners));
            }
        }
        None
    }

    fn candidate(
        &self,
        space: &Space,
        request: &ReachRequest,
        member: Member,
        failures: &mut Failures,
    ) -> Option<Candidate> {
        if let Some(pair) = space.too_close(&member.q) {
            failures.colliding += 1;
            failures.collision = space.describe(&pair);
            return None;
        }
        if request.sweep <= 0.0 {
            return Some(Candidate { member, sweep: None });
        }
        match sweep::swept(space, &self.chain, &member.q, request.sweep, HALF_SWEEP_STEPS) {
            Ok(sweep) => Some(Candidate { member, sweep: Some(sweep) }),
            Err(why) => {
                failures.sweeping += 1;
                failures.sweep = why;
                None
            }
        }
    }

    fn reached(&self, candidate: Candidate, corners: &[Vec<f64>]) -> Reached {
        let path = parametrised(&self.robot, corners);
        let sweep = candidate.sweep;
        let duration = path.duration() + sweep.as_ref().map_or(0.0, Trajectory::duration);
        let Member { q, pose, .. } = candidate.member;
        Reached { q, object_from_sensor: pose, path, sweep, duration }
    }
}

impl Failures {
    fn hindrance(&self) -> Hindrance {
        match self {
            Failures { paths: 1.., .. } => Hindrance::Way,
            Failures { sweeping: 1.., .. } => Hindrance::Sweep,
            Failures { members: 1.., .. } => Hindrance::Collision,
            _ => Hindrance::Limits,
        }
    }

    fn reason(&self) -> String {
        let Failures { members, colliding, sweeping, paths, .. } = self;
        if *members == 0 {
            return "out of reach: no joint positions within the limits take this view at any roll or distance"
                .to_owned();
        }
        let mut parts = Vec::new();
        if *colliding > 0 {
            parts.push(format!("{colliding} collide (such as {})", self.collision));
        }
        if *sweeping > 0 {
            parts.push(format!("{sweeping} cannot sweep ({})", self.sweep));
        }
        if *paths > 0 {
            parts.push(format!("to {paths} no free way was found in {PATH_SAMPLES} samples"));
        }
        format!("of {members} configurations that take this view, {}", parts.join(", "))
    }
}
