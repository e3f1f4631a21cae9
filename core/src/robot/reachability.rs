//! Whether the robot can take a view, and with which motion.

use super::collision::Obstacle;
use super::planning_space::PlanningSpace;
use super::rrt_connect::plan_path;
use super::sweep::{HALF_SWEEP_STEPS, plan_sweep};
use super::trajectory::{Trajectory, time_parametrise};
use super::view_solutions::{IkSearch, IkSolution, solve_view};
use super::workcell::Workcell;
use crate::Result;
use crate::geometry::{Pose, SensorModel};

/// A view to be taken.
#[derive(Clone, Copy, Debug)]
pub struct ReachabilityRequest<'a> {
    /// The viewpoint `object_from_sensor`. Its roll about the viewing axis is free.
    pub view: Pose,
    /// Where the motion starts: a position for each joint of the robot, radians and metres.
    pub start: &'a [f64],
    /// Length of the sensor's sweep along its y axis about the viewpoint, metres; 0 for none.
    pub sweep: f64,
    /// How far the sensor may move from the viewpoint along its viewing axis: lowest (negative:
    /// farther from the object) and highest (positive: closer to it), metres; see [`slide_range`].
    pub slide: [f64; 2],
    /// What is known of the object's extent.
    pub obstacle: &'a Obstacle,
    /// Minimum clearance between bodies at the view and during the sweep, metres. Half of it is
    /// required on the path to the view.
    pub margin: f64,
}

/// Whether a view can be taken.
#[derive(Clone, Debug, PartialEq)]
pub enum Reachability {
    /// The view can be taken.
    Reachable(Box<ViewMotion>),
    /// The view cannot be taken with any roll, distance or posture of the arm that was tried.
    Unreachable {
        /// What the configurations that passed most of the checks failed at.
        cause: UnreachableCause,
        /// The reason as a text for the user.
        reason: String,
    },
}

/// What keeps the robot from a view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnreachableCause {
    /// The robot is in collision at the start.
    StartInCollision,
    /// No joint positions within the limits take the view.
    OutOfReach,
    /// All configurations that take the view are in collision.
    ViewInCollision,
    /// From all configurations that are free, the sensor cannot sweep.
    NoSweep,
    /// No free path was found to any configuration that is free.
    NoPath,
}

impl UnreachableCause {
    /// Completes a sentence on a view, such as "3 views were ...".
    pub fn describe(self) -> &'static str {
        match self {
            UnreachableCause::StartInCollision => {
                "not asked, since the robot stands in a collision"
            }
            UnreachableCause::OutOfReach => "out of reach",
            UnreachableCause::ViewInCollision => "in collision",
            UnreachableCause::NoSweep => "without room for the sweep",
            UnreachableCause::NoPath => "without a free way",
        }
    }
}

/// The motion that takes a view.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewMotion {
    /// Joint positions at the viewpoint, radians and metres.
    pub q: Vec<f64>,
    /// The viewpoint with roll and distance as chosen.
    pub object_from_sensor: Pose,
    /// The path from the start to `q`.
    pub path: Trajectory,
    /// The sweep about `q`, if one was asked for.
    pub sweep: Option<Trajectory>,
    /// Duration of path and sweep together, seconds.
    pub duration: f64,
}

/// The slide that keeps the centre of the object between `1 - share` and `1 + share` times the
/// working distance and within the sensor's range: lowest and highest, metres.
pub fn slide_range(sensor: &SensorModel, share: f64) -> [f64; 2] {
    let (distance, [near, far]) = (sensor.working_distance(), sensor.range());
    let back = (distance * share).min(far - distance).max(0.0);
    let forth = (distance * share).min(distance - near).max(0.0);
    [-back, forth]
}

/// Numbers of seeds of the inverse kinematics: of the first search, at the viewpoint itself, and of
/// the second, with the distance free.
const SEED_COUNTS: [usize; 2] = [24, 96];
/// Number of configurations that one path search may end in.
const MAX_GOALS: usize = 10;
/// Number of path searches, each with other goals.
const MAX_PATH_SEARCHES: usize = 4;
/// Number of random samples of one path search.
const MAX_PATH_SAMPLES: usize = 1500;

/// Counts of the configurations that failed, by what they failed at, with the last text of each.
#[derive(Default)]
struct FailureCounts {
    configurations: usize,
    in_collision: usize,
    collision: String,
    without_sweep: usize,
    sweep: String,
    without_path: usize,
}

/// A configuration that is free and can sweep; a path to it is not known yet.
struct FreeSolution {
    solution: IkSolution,
    sweep: Option<Trajectory>,
}

impl Workcell {
    /// Whether the robot can take a view, and with which motion.
    ///
    /// # Errors
    /// As [`RobotModel::check_configuration`](super::RobotModel::check_configuration) of the start.
    pub fn check_reachability(&self, request: &ReachabilityRequest) -> Result<Reachability> {
        self.robot.check_configuration(request.start)?;
        let collisions = self.collisions.with_obstacle(&self.robot, &self.chain, request.obstacle);
        let space = self.planning_space(&collisions, request.margin);
        if let Some(pair) = space.collision_between(request.start, request.start) {
            return Ok(Reachability::Unreachable {
                cause: UnreachableCause::StartInCollision,
                reason: format!(
                    "the robot stands in a collision: {} are {:.1} mm apart; move it by hand",
                    space.describe_pair(&pair),
                    pair.distance * 1e3
                ),
            });
        }
        let mut failures = FailureCounts::default();
        let [low, high] = request.slide;
        let slides = [[0f64.clamp(low, high); 2], [low, high]];
        for (seed_count, slide) in SEED_COUNTS.into_iter().zip(slides) {
            let solutions = solve_view(
                &self.robot,
                &self.chain,
                &self.seeds,
                &request.view,
                request.start,
                IkSearch { seed_count, slide },
            );
            if let Some(motion) = self.choose_motion(&space, request, solutions, &mut failures) {
                return Ok(Reachability::Reachable(Box::new(motion)));
            }
        }
        Ok(Reachability::Unreachable { cause: failures.cause(), reason: failures.reason() })
    }

    /// The motion to the first configuration that is free, can sweep and has a straight path; else
    /// to one of the first of them that a path round the obstacles leads to.
    fn choose_motion(
        &self,
        space: &PlanningSpace,
        request: &ReachabilityRequest,
        solutions: Vec<IkSolution>,
        failures: &mut FailureCounts,
    ) -> Option<ViewMotion> {
        let mut solutions = solutions.into_iter();
        for _ in 0..MAX_PATH_SEARCHES {
            let mut goals: Vec<FreeSolution> = Vec::new();
            for solution in solutions.by_ref() {
                failures.configurations += 1;
                let Some(free) = self.check_solution(space, request, solution, failures) else {
                    continue;
                };
                if space.collision_between(request.start, &free.solution.q).is_none() {
                    let corners = [request.start.to_vec(), free.solution.q.clone()];
                    return Some(self.view_motion(free, &corners));
                }
                goals.push(free);
                if goals.len() >= MAX_GOALS {
                    break;
                }
            }
            if goals.is_empty() {
                return None;
            }
            failures.without_path += goals.len();
            let ends: Vec<Vec<f64>> = goals.iter().map(|goal| goal.solution.q.clone()).collect();
            if let Some(corners) = plan_path(space, request.start, &ends, MAX_PATH_SAMPLES) {
                let end = corners.last()?;
                let goal = goals.into_iter().find(|goal| goal.solution.q == *end)?;
                return Some(self.view_motion(goal, &corners));
            }
        }
        None
    }

    /// The solution with its sweep, if it is free and can sweep; else it is counted in `failures`.
    fn check_solution(
        &self,
        space: &PlanningSpace,
        request: &ReachabilityRequest,
        solution: IkSolution,
        failures: &mut FailureCounts,
    ) -> Option<FreeSolution> {
        if let Some(pair) = space.collision_at(&solution.q) {
            failures.in_collision += 1;
            failures.collision = space.describe_pair(&pair);
            return None;
        }
        if request.sweep <= 0.0 {
            return Some(FreeSolution { solution, sweep: None });
        }
        match plan_sweep(space, &self.chain, &solution.q, request.sweep, HALF_SWEEP_STEPS) {
            Ok(sweep) => Some(FreeSolution { solution, sweep: Some(sweep) }),
            Err(why) => {
                failures.without_sweep += 1;
                failures.sweep = why;
                None
            }
        }
    }

    fn view_motion(&self, free: FreeSolution, corners: &[Vec<f64>]) -> ViewMotion {
        let path = time_parametrise(&self.robot, corners);
        let sweep = free.sweep;
        let duration = path.duration() + sweep.as_ref().map_or(0.0, Trajectory::duration);
        let IkSolution { q, pose, .. } = free.solution;
        ViewMotion { q, object_from_sensor: pose, path, sweep, duration }
    }
}

impl FailureCounts {
    fn cause(&self) -> UnreachableCause {
        match self {
            FailureCounts { without_path: 1.., .. } => UnreachableCause::NoPath,
            FailureCounts { without_sweep: 1.., .. } => UnreachableCause::NoSweep,
            FailureCounts { configurations: 1.., .. } => UnreachableCause::ViewInCollision,
            _ => UnreachableCause::OutOfReach,
        }
    }

    fn reason(&self) -> String {
        let FailureCounts { configurations, in_collision, without_sweep, without_path, .. } = self;
        if *configurations == 0 {
            return "out of reach: no joint positions within the limits take this view at any roll or distance"
                .to_owned();
        }
        let mut parts = Vec::new();
        if *in_collision > 0 {
            parts.push(format!("{in_collision} collide (such as {})", self.collision));
        }
        if *without_sweep > 0 {
            parts.push(format!("{without_sweep} cannot sweep ({})", self.sweep));
        }
        if *without_path > 0 {
            parts.push(format!(
                "to {without_path} no free way was found in {MAX_PATH_SAMPLES} samples"
            ));
        }
        format!("of {configurations} configurations that take this view, {}", parts.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{StereoModel, StriperModel};

    #[test]
    fn the_slide_keeps_the_object_within_the_range_of_the_sensor() {
        for sensor in [
            SensorModel::Striper(StriperModel::SCANCONTROL),
            SensorModel::Stereo(StereoModel::GUPPY),
        ] {
            let (distance, [near, far]) = (sensor.working_distance(), sensor.range());
            for share in [0.0, 0.05, 0.15, 0.9] {
                let [back, forth] = slide_range(&sensor, share);
                assert!(back <= 0.0 && forth >= 0.0);
                assert!(-back <= share * distance && forth <= share * distance);
                assert!(distance - back <= far + 1e-12 && distance - forth >= near - 1e-12);
            }
            assert_eq!(slide_range(&sensor, 0.0).map(f64::abs), [0.0, 0.0]);
        }
    }

    #[test]
    fn the_cause_is_what_the_farthest_configurations_failed_at() {
        let mut failures = FailureCounts::default();
        assert_eq!(failures.cause(), UnreachableCause::OutOfReach);
        assert!(failures.reason().starts_with("out of reach"));
        failures.configurations = 3;
        failures.in_collision = 3;
        failures.collision = "`a` and `b`".to_owned();
        assert_eq!(failures.cause(), UnreachableCause::ViewInCollision);
        failures.configurations = 5;
        failures.without_sweep = 1;
        failures.sweep = "the sweep passes a singularity".to_owned();
        assert_eq!(failures.cause(), UnreachableCause::NoSweep);
        failures.without_path = 1;
        assert_eq!(failures.cause(), UnreachableCause::NoPath);
        assert_eq!(
            failures.reason(),
            "of 5 configurations that take this view, 3 collide (such as `a` and `b`), 1 cannot sweep \
             (the sweep passes a singularity), to 1 no free way was found in 1500 samples"
        );
    }
}
