//! All joint positions that take a view: the roll about the viewing axis and the distance are free,
//! and the inverse kinematics is solved from many seeds.

use super::inverse_kinematics::{PositionBounds, solve_inverse_kinematics};
use super::kinematic_chain::{KinematicChain, view_from_sensor};
use super::model::{Joint, JointKind, RobotModel};
use super::rrt_connect::sampling_range;
use crate::geometry::{Pose, Vec3};
use std::f64::consts::{PI, TAU};

/// Iterations of a search from a seed, which is far from the solution.
const MAX_ITERATIONS_FROM_SEED: usize = 40;
/// Iterations of a search from one solution to its neighbour in roll.
const MAX_ITERATIONS_FROM_NEIGHBOUR: usize = 8;
/// Difference in roll of neighbouring solutions, radians.
const ROLL_STEP: f64 = PI / 12.0;
/// Neighbours that are looked for in either direction: half a turn of roll.
const ROLL_STEPS_PER_DIRECTION: usize = 12;
/// A difference of one radian in direction counts as much as this distance when the seeds nearest
/// to a view are chosen, metres.
const METRES_PER_RADIAN: f64 = 0.3;
/// Weight of the slide in the inverse kinematics, where that of a joint is 1: the joints move
/// first.
const SLIDE_WEIGHT: f64 = 0.1;
/// Solutions of which no position differs by more than this are the same, radians or metres.
const SAME_SOLUTION_TOLERANCE: f64 = 0.1;

/// Configurations spread over the joint limits, with the views that they take.
#[derive(Clone, Debug)]
pub(crate) struct SeedSet {
    seeds: Vec<IkSeed>,
}

#[derive(Clone, Debug)]
struct IkSeed {
    /// Positions of the chain's joints.
    joints: Vec<f64>,
    /// Position of the sensor in the object frame, metres.
    position: Vec3,
    /// Viewing axis of the sensor in the object frame.
    axis: Vec3,
}

impl SeedSet {
    /// The seeds at the joint positions `samples` of the robot.
    pub(crate) fn new(chain: &KinematicChain, samples: &[Vec<f64>]) -> SeedSet {
        let seeds = samples.iter().map(|q| IkSeed::new(chain, q)).collect();
        SeedSet { seeds }
    }

    /// The `count` seeds nearest to the view, nearest first; of equals the first one.
    fn nearest(&self, view: &Pose, count: usize) -> Vec<&IkSeed> {
        let mut order: Vec<(f64, usize)> =
            self.seeds.iter().enumerate().map(|(i, seed)| (seed.cost(view), i)).collect();
        if count < order.len() {
            order.select_nth_unstable_by(count, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            order.truncate(count);
        }
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        order.iter().map(|&(_, i)| &self.seeds[i]).collect()
    }
}

impl IkSeed {
    fn new(chain: &KinematicChain, q: &[f64]) -> IkSeed {
        let joints = chain.joint_positions(q);
        let pose = chain.end_pose(&joints);
        let (position, axis) = (pose.translation.vector, pose.rotation * Vec3::z());
        IkSeed { joints, position, axis }
    }

    /// Square of the distance to a view, square metres.
    fn cost(&self, view: &Pose) -> f64 {
        let (position, axis) = (view.translation.vector, view.rotation * Vec3::z());
        // 1 - cos is half the square of a small angle.
        let squared_angle = 2.0 * (1.0 - self.axis.dot(&axis));
        (self.position - position).norm_squared() + METRES_PER_RADIAN.powi(2) * squared_angle
    }
}

/// Joint positions that take the view, with slide and roll as chosen.
#[derive(Clone, Debug)]
pub(crate) struct IkSolution {
    pub q: Vec<f64>,
    /// The pose `object_from_sensor`.
    pub pose: Pose,
    /// Time that the slowest joint needs from the start at full speed, seconds.
    pub time: f64,
}

/// How far the solutions of a view are searched.
#[derive(Clone, Copy, Debug)]
pub(crate) struct IkSearch {
    pub seed_count: usize,
    /// Lowest and highest slide along the viewing axis, metres.
    pub slide: [f64; 2],
}

/// The joint positions that take `view` (`object_from_sensor`), those first that `start` reaches
/// soonest.
pub(crate) fn solve_view(
    robot: &RobotModel,
    chain: &KinematicChain,
    seeds: &SeedSet,
    view: &Pose,
    start: &[f64],
    search: IkSearch,
) -> Vec<IkSolution> {
    let start_joints = chain.joint_positions(start);
    let nearest = seeds.nearest(view, search.seed_count);
    let mut bounds = search_bounds(robot, chain, search.slide);
    let roll_index = chain.len() - 1;
    let mut solutions: Vec<Vec<f64>> = Vec::new();
    for joints in std::iter::once(&start_joints).chain(nearest.iter().map(|s| &s.joints)) {
        let slide = 0f64.clamp(search.slide[0], search.slide[1]);
        let roll = nearest_roll(view, &chain.end_pose(joints));
        let seed: Vec<f64> = joints.iter().copied().chain([slide, roll]).collect();
        bounds.weights[roll_index] = 1.0;
        let Some(solution) =
            solve_inverse_kinematics(chain, view, &seed, &bounds, MAX_ITERATIONS_FROM_SEED)
        else {
            continue;
        };
        if solutions.iter().any(|other| is_same_solution(other, &solution)) {
            continue;
        }
        bounds.weights[roll_index] = 0.0;
        for direction in [1.0, -1.0] {
            solutions.extend(follow_roll(chain, view, &solution, &bounds, direction));
        }
        solutions.push(solution);
    }
    let mut found: Vec<IkSolution> = solutions
        .iter()
        .flat_map(|x| {
            let pose = view * view_from_sensor(x[roll_index - 1], x[roll_index]);
            full_turn_variants(robot, chain, x, start).into_iter().map(move |q| (q, pose))
        })
        .map(|(q, pose)| IkSolution { time: robot.min_travel_time(start, &q), q, pose })
        .collect();
    found.sort_by(|a, b| a.time.total_cmp(&b.time));
    found
}

/// Solutions at neighbouring rolls, one after the other, until one is not found. The weight of the
/// roll in `bounds` must be 0.
fn follow_roll(
    chain: &KinematicChain,
    view: &Pose,
    solution: &[f64],
    bounds: &PositionBounds,
    direction: f64,
) -> Vec<Vec<f64>> {
    let mut found = Vec::new();
    let mut x = solution.to_vec();
    for _ in 0..ROLL_STEPS_PER_DIRECTION {
        x[chain.len() - 1] += direction * ROLL_STEP;
        match solve_inverse_kinematics(chain, view, &x, bounds, MAX_ITERATIONS_FROM_NEIGHBOUR) {
            Some(next) => x = next,
            None => break,
        }
        found.push(x.clone());
    }
    found
}

fn search_bounds(robot: &RobotModel, chain: &KinematicChain, slide: [f64; 2]) -> PositionBounds {
    let mut limits: Vec<[f64; 2]> = chain.joints.iter().map(|&j| robot.joints[j].limits).collect();
    let mut weights = vec![1.0; limits.len()];
    limits.extend([slide, [f64::NEG_INFINITY, f64::INFINITY]]);
    weights.extend([if slide[0] < slide[1] { SLIDE_WEIGHT } else { 0.0 }, 1.0]);
    PositionBounds { limits, weights }
}

/// The roll that brings the view closest to the pose of the sensor, radians.
fn nearest_roll(view: &Pose, sensor: &Pose) -> f64 {
    let turn = (view.rotation.inverse() * sensor.rotation).to_rotation_matrix();
    (turn[(1, 0)] - turn[(0, 1)]).atan2(turn[(0, 0)] + turn[(1, 1)])
}

/// Whether all positions of two solutions agree, up to full turns.
fn is_same_solution(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).map(|(a, b)| ((a - b + PI).rem_euclid(TAU) - PI).abs()).fold(0.0, f64::max)
        < SAME_SOLUTION_TOLERANCE
}

/// The robot's joint positions for the chain positions `x`: first with each turning joint at the
/// equivalent angle that is nearest to `start`, and then with one such joint at its second nearest.
fn full_turn_variants(
    robot: &RobotModel,
    chain: &KinematicChain,
    x: &[f64],
    start: &[f64],
) -> Vec<Vec<f64>> {
    let mut nearest = start.to_vec();
    let mut alternatives = Vec::new();
    for (&joint, &value) in chain.joints.iter().zip(x) {
        let Joint { kind, limits, .. } = &robot.joints[joint];
        let mut angles = match kind {
            JointKind::Prismatic => vec![value],
            JointKind::Revolute | JointKind::Continuous => equivalent_angles(value, *limits),
        };
        angles.sort_by(|a, b| (a - start[joint]).abs().total_cmp(&(b - start[joint]).abs()));
        nearest[joint] = angles.first().copied().unwrap_or(value);
        alternatives.extend(angles.get(1).map(|&angle| (joint, angle)));
    }
    let mut variants = vec![nearest.clone()];
    for (joint, angle) in alternatives {
        let mut q = nearest.clone();
        q[joint] = angle;
        variants.push(q);
    }
    variants
}

/// The angles that differ from `value` by full turns and lie within the limits, or within a full
/// turn to either side if there are none.
fn equivalent_angles(value: f64, limits: [f64; 2]) -> Vec<f64> {
    let [low, high] = sampling_range(limits);
    let first = ((low - value) / TAU).ceil() as i64;
    let last = ((high - value) / TAU).floor() as i64;
    (first..=last).map(|turn| value + turn as f64 * TAU).collect()
}

#[cfg(test)]
mod tests {
    use super::super::planar_arm_tests::{chain, planar_arm};
    use super::*;
    use crate::geometry::{Twist, exp, log};

    #[test]
    fn equivalent_angles_differ_by_full_turns_within_the_limits() {
        assert_eq!(equivalent_angles(0.5, [-1.0, 1.0]), [0.5]);
        let found = equivalent_angles(3.0, [-7.0, 7.0]);
        assert_eq!(found.len(), 2);
        assert!((found[0] - (3.0 - TAU)).abs() < 1e-12 && (found[1] - 3.0).abs() < 1e-12);
        let found = equivalent_angles(9.0, [-1.0, 3.0]);
        assert!(found.len() == 1 && (found[0] - (9.0 - TAU)).abs() < 1e-12);
        assert!(equivalent_angles(2.0, [-1.0, 1.0]).is_empty());
        // Without limits: a full turn to either side.
        assert_eq!(equivalent_angles(0.5, [f64::NEG_INFINITY, f64::INFINITY]).len(), 2);
    }

    #[test]
    fn the_same_solution_may_differ_by_full_turns() {
        assert!(is_same_solution(&[0.1, 3.0], &[0.15, 3.0 - TAU]));
        assert!(is_same_solution(&[PI - 0.02], &[-PI + 0.02]));
        assert!(!is_same_solution(&[0.1, 3.0], &[0.25, 3.0]));
    }

    #[test]
    fn the_nearest_roll_leaves_the_smallest_rotation() {
        let view = exp(&Twist::new(0.1, 0.2, 0.3, 0.4, -0.7, 0.2));
        for roll in [-2.5, -0.4, 0.0, 1.3, 3.0] {
            let sensor = view * view_from_sensor(0.05, roll);
            assert!((nearest_roll(&view, &sensor) - roll).abs() < 1e-12);
            // Of a sensor that does not lie in the family, no other roll is closer.
            let sensor = sensor * exp(&Twist::new(0.0, 0.0, 0.0, 0.3, 0.2, 0.0));
            let best = nearest_roll(&view, &sensor);
            let [at_best, left, right] = [0.0, -0.01, 0.01].map(|offset| {
                let rolled = view * view_from_sensor(0.0, best + offset);
                (rolled.rotation.inverse() * sensor.rotation).angle()
            });
            assert!(at_best < left && at_best < right, "{roll}");
        }
    }

    #[test]
    fn seeds_are_chosen_by_their_distance_to_the_view() {
        let chain = chain(&planar_arm());
        let samples: Vec<Vec<f64>> = (0..400)
            .map(|i| vec![f64::from(i % 20) * 0.3 - 2.9, f64::from(i / 20) * 0.3 - 2.9])
            .collect();
        let seeds = SeedSet::new(&chain, &samples);
        let view = chain.end_pose(&[0.33, 0.71]);
        let nearest = seeds.nearest(&view, 7);
        assert_eq!(nearest.len(), 7);
        assert!(nearest.is_sorted_by(|a, b| a.cost(&view) <= b.cost(&view)));
        let worst = nearest[6].cost(&view);
        let closer = seeds.seeds.iter().filter(|seed| seed.cost(&view) < worst).count();
        assert_eq!(closer, 6);
        assert_eq!(seeds.nearest(&view, 1000).len(), 400);
    }

    #[test]
    fn solutions_of_a_planar_arm_take_the_view_with_both_slides() {
        let robot = planar_arm();
        let chain = chain(&robot);
        let samples: Vec<Vec<f64>> = (0..100)
            .map(|i| vec![f64::from(i % 10) * 0.6 - 2.7, f64::from(i / 10) * 0.6 - 2.7])
            .collect();
        let seeds = SeedSet::new(&chain, &samples);
        // The tip is 0.05 m before the view, along its viewing axis.
        let view = chain.end_pose(&[0.4, 0.9]) * view_from_sensor(0.05, 0.0).inverse();
        let start = [0.0, 0.5];
        let search = IkSearch { seed_count: 8, slide: [-0.1, 0.1] };
        let found = solve_view(&robot, &chain, &seeds, &view, &start, search);
        assert!(!found.is_empty());
        for solution in &found {
            let end = chain.end_pose(&solution.q);
            assert!(log(&(solution.pose.inverse() * end)).norm() < 1e-6);
            let slide = (view.inverse() * solution.pose).translation.vector;
            assert!(slide.x.abs() < 1e-6 && slide.y.abs() < 1e-6 && slide.z.abs() <= 0.1 + 1e-9);
            assert!((solution.time - robot.min_travel_time(&start, &solution.q)).abs() < 1e-12);
        }
    }
}
