//! Plans a collision-free path of the joints: straight if that is free, else by RRT-Connect
//! (Kuffner & LaValle 2000, RRT-Connect: an efficient approach to single-query path planning).
//! It departs from the paper in two points: the goal tree is rooted in all configurations that
//! would do, and one connect step goes on from the node that it added last instead of asking for
//! the nearest node again. The path found is then shortened.

use super::planning_space::{PlanningSpace, interpolate};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Longest step of a tree, as the time that the slowest joint needs for it, seconds.
const MAX_STEP_TIME: f64 = 0.25;
/// Seed of the random samples. Its value does not matter, but it must not change, so that the same
/// request always gives the same path.
const RANDOM_SEED: u64 = 11;
/// Number of attempts to replace a part of the path by a straight line.
const SHORTCUT_ATTEMPTS: usize = 60;

/// A tree of configurations whose edges are free straight motions. It may have several roots.
struct Tree {
    nodes: Vec<Vec<f64>>,
    /// Index of each node's parent; roots are their own parents.
    parents: Vec<usize>,
}

impl Tree {
    fn new(roots: &[Vec<f64>]) -> Tree {
        Tree { nodes: roots.to_vec(), parents: (0..roots.len()).collect() }
    }

    /// Adds a node and returns its index.
    fn add(&mut self, node: Vec<f64>, parent: usize) -> usize {
        self.nodes.push(node);
        self.parents.push(parent);
        self.nodes.len() - 1
    }

    /// The node from which the slowest joint reaches `target` soonest; the first one of equals.
    fn nearest(&self, space: &PlanningSpace, target: &[f64]) -> Option<usize> {
        let times: Vec<f64> =
            self.nodes.iter().map(|node| space.robot.min_travel_time(node, target)).collect();
        (0..times.len()).min_by(|&a, &b| times[a].total_cmp(&times[b]).then(a.cmp(&b)))
    }

    /// The nodes from `index` to its root.
    fn path_to_root(&self, mut index: usize) -> Vec<Vec<f64>> {
        let mut nodes = vec![self.nodes[index].clone()];
        while self.parents[index] != index {
            index = self.parents[index];
            nodes.push(self.nodes[index].clone());
        }
        nodes
    }
}

/// What became of growing a tree towards a target, in the paper's terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Extend {
    /// The node of this index was added, which is the target.
    Reached(usize),
    /// The node of this index was added, a step closer to the target.
    Advanced(usize),
    /// The step is not free: nothing was added.
    Trapped,
}

/// The corners of a free path from `start` to one of `goals`, both included; `None` if it was not
/// found with `max_samples` random samples.
pub(crate) fn plan_path(
    space: &PlanningSpace,
    start: &[f64],
    goals: &[Vec<f64>],
    max_samples: usize,
) -> Option<Vec<Vec<f64>>> {
    let mut rng = ChaCha8Rng::seed_from_u64(RANDOM_SEED);
    let mut trees = [Tree::new(&[start.to_vec()]), Tree::new(goals)];
    for turn in 0..max_samples {
        let sample = sample_configuration(space, start, &mut rng);
        let (extended, connected) = (turn % 2, 1 - turn % 2);
        let nearest = trees[extended].nearest(space, &sample)?;
        let (Extend::Reached(node) | Extend::Advanced(node)) =
            extend(space, &mut trees[extended], nearest, &sample)
        else {
            continue;
        };
        let target = trees[extended].nodes[node].clone();
        if let Extend::Reached(met) = connect(space, &mut trees[connected], &target) {
            let ends = if extended == 0 { [node, met] } else { [met, node] };
            let mut path = trees[0].path_to_root(ends[0]);
            path.reverse();
            // Both branches end in the same configuration.
            path.extend(trees[1].path_to_root(ends[1]).into_iter().skip(1));
            return Some(shorten_path(space, path, &mut rng));
        }
    }
    None
}

/// Grows the tree from the node `from` by one step towards `target`.
fn extend(space: &PlanningSpace, tree: &mut Tree, from: usize, target: &[f64]) -> Extend {
    let time = space.robot.min_travel_time(&tree.nodes[from], target);
    let next = interpolate(&tree.nodes[from], target, (MAX_STEP_TIME / time).min(1.0));
    if space.collision_between(&tree.nodes[from], &next).is_some() {
        return Extend::Trapped;
    }
    let added = tree.add(next, from);
    if time <= MAX_STEP_TIME { Extend::Reached(added) } else { Extend::Advanced(added) }
}

/// Grows the tree from its nearest node towards `target` until it is there or trapped.
fn connect(space: &PlanningSpace, tree: &mut Tree, target: &[f64]) -> Extend {
    let Some(mut from) = tree.nearest(space, target) else { return Extend::Trapped };
    loop {
        match extend(space, tree, from, target) {
            Extend::Advanced(added) => from = added,
            end => return end,
        }
    }
}

/// A random configuration within the limits. Joints that do not move the sensor against the object
/// keep their positions in `start`.
fn sample_configuration(space: &PlanningSpace, start: &[f64], rng: &mut ChaCha8Rng) -> Vec<f64> {
    let mut q = start.to_vec();
    for &joint in space.active_joints {
        let [low, high] = sampling_range(space.robot.joints[joint].limits);
        q[joint] = rng.random_range(low..=high);
    }
    q
}

/// The range that positions of a joint are drawn from: its limits, or a full turn to either side
/// for a joint without limits.
pub(crate) fn sampling_range(limits: [f64; 2]) -> [f64; 2] {
    let turn = std::f64::consts::TAU;
    if limits.iter().all(|l| l.is_finite()) { limits } else { [-turn, turn] }
}

/// Shortens the path: joins two random points of it by a straight motion wherever that is free, and
/// then leaves out corners that are not needed any more.
fn shorten_path(
    space: &PlanningSpace,
    mut path: Vec<Vec<f64>>,
    rng: &mut ChaCha8Rng,
) -> Vec<Vec<f64>> {
    for _ in 0..SHORTCUT_ATTEMPTS {
        if path.len() < 3 {
            break;
        }
        // A place on the path: index of the leg, plus the share of that leg.
        let mut places = [0; 2].map(|_| rng.random_range(0.0..(path.len() - 1) as f64));
        places.sort_by(f64::total_cmp);
        let legs = places.map(|place| place as usize);
        if legs[0] == legs[1] {
            continue;
        }
        let points = [0, 1]
            .map(|i| interpolate(&path[legs[i]], &path[legs[i] + 1], places[i] - legs[i] as f64));
        if space.collision_between(&points[0], &points[1]).is_none() {
            path.splice(legs[0] + 1..=legs[1], points);
        }
    }
    let mut corner = 1;
    while corner + 1 < path.len() {
        if space.collision_between(&path[corner - 1], &path[corner + 1]).is_none() {
            path.remove(corner);
        } else {
            corner += 1;
        }
    }
    path
}

#[cfg(test)]
mod tests {
    use super::super::collision::{CollisionChecker, Obstacle};
    use super::super::planar_arm_tests::{chain, planar_arm};
    use super::*;
    use crate::geometry::Vec3;
    use crate::robot::RobotModel;

    /// The planar arm with a ball beside it, which the straight arm cannot pass but the folded one
    /// can.
    fn blocked_arm() -> (RobotModel, CollisionChecker, Vec<usize>) {
        let robot = planar_arm();
        let chain = chain(&robot);
        let object = robot.link("object").unwrap();
        let obstacle = Obstacle::from_sphere(&Vec3::new(0.0, 0.7, 0.0), 0.1);
        let collisions = CollisionChecker::new(&robot, &chain, object, &[])
            .with_obstacle(&robot, &chain, &obstacle);
        (robot, collisions, chain.joints)
    }

    #[test]
    fn extend_advances_reaches_or_is_trapped() {
        let (robot, collisions, joints) = blocked_arm();
        let space = PlanningSpace {
            robot: &robot,
            collisions: &collisions,
            active_joints: &joints,
            margin: 0.01,
        };
        let mut tree = Tree::new(&[vec![0.0, 0.0]]);
        // The joints turn 2 rad/s, so that a step is 0.5 rad of the slowest joint.
        assert_eq!(extend(&space, &mut tree, 0, &[0.8, 0.1]), Extend::Advanced(1));
        assert!(
            (tree.nodes[1][0] - 0.5).abs() < 1e-12 && (tree.nodes[1][1] - 0.0625).abs() < 1e-12
        );
        assert_eq!(extend(&space, &mut tree, 1, &[0.8, 0.1]), Extend::Reached(2));
        assert_eq!((&tree.nodes[2], &tree.parents), (&vec![0.8, 0.1], &vec![0, 0, 1]));
        // Straight towards the ball.
        let ahead = [std::f64::consts::FRAC_PI_2, 0.0];
        assert_eq!(connect(&space, &mut tree, &ahead), Extend::Trapped);
        assert_eq!(tree.path_to_root(2), [vec![0.8, 0.1], vec![0.5, 0.0625], vec![0.0, 0.0]]);
        assert_eq!(tree.nearest(&space, &[0.45, 0.0]), Some(1));
    }

    #[test]
    fn paths_lead_from_start_to_a_goal_without_collision_the_same_each_time() {
        let (robot, collisions, joints) = blocked_arm();
        let space = PlanningSpace {
            robot: &robot,
            collisions: &collisions,
            active_joints: &joints,
            margin: 0.01,
        };
        let (start, goals) = (vec![0.2, 0.1], [vec![2.8, 0.1], vec![2.8, -0.3]]);
        assert!(space.collision_between(&start, &goals[0]).is_some());
        let path = plan_path(&space, &start, &goals, 1000).unwrap();
        assert_eq!(path.first(), Some(&start));
        assert!(goals.contains(path.last().unwrap()) && path.len() > 2);
        for leg in path.windows(2) {
            for i in 0..=200 {
                let q = interpolate(&leg[0], &leg[1], f64::from(i) / 200.0);
                let distance = collisions.clearance(&robot.forward_kinematics(&q), 1.0).distance;
                assert!(distance > 0.005 - 1e-3, "{q:?}: {distance}");
                assert_eq!(robot.joint_beyond_limits(&q), None);
            }
        }
        assert_eq!(plan_path(&space, &start, &goals, 1000), Some(path));
        // In collision itself, a goal has no path.
        let inside = [vec![std::f64::consts::FRAC_PI_2, 0.0]];
        assert_eq!(plan_path(&space, &start, &inside, 100), None);
    }

    #[test]
    fn sampling_ranges_are_finite() {
        assert_eq!(sampling_range([-0.5, 2.0]), [-0.5, 2.0]);
        let [low, high] = sampling_range([f64::NEG_INFINITY, f64::INFINITY]);
        assert!((high - low - 4.0 * std::f64::consts::PI).abs() < 1e-12);
    }
}
