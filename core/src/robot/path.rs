//! A way for the joints free of collisions: straight if that is free, else by two growing trees (Kuffner & LaValle
//! 2000, RRT-Connect), the second rooted in all configurations that would do; then shortened.

use super::motion::{Space, between};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Longest step of a tree, seconds of the slowest joint.
const STEP: f64 = 0.25;
/// Seed of the samples: any will do, it only has to stay.
const SEED: u64 = 11;
/// Attempts at cutting a corner.
const SHORTCUTS: usize = 60;

struct Tree {
    nodes: Vec<Vec<f64>>,
    /// Roots are their own parents.
    parents: Vec<usize>,
}

impl Tree {
    fn new(roots: &[Vec<f64>]) -> Tree {
        Tree { nodes: roots.to_vec(), parents: (0..roots.len()).collect() }
    }

    /// Nodes from `index` up to its root.
    fn branch(&self, mut index: usize) -> Vec<Vec<f64>> {
        let mut nodes = vec![self.nodes[index].clone()];
        while self.parents[index] != index {
            index = self.parents[index];
            nodes.push(self.nodes[index].clone());
        }
        nodes
    }
}

/// Corners of a way from `start` to one of `goals`; none if `iterations` samples did not find one.
pub(crate) fn search(
    space: &Space,
    start: &[f64],
    goals: &[Vec<f64>],
    iterations: usize,
) -> Option<Vec<Vec<f64>>> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut trees = [Tree::new(&[start.to_vec()]), Tree::new(goals)];
    for turn in 0..iterations {
        let sample = sample(space, start, &mut rng);
        let (own, other) = (turn % 2, 1 - turn % 2);
        let (reached, _) = grow(space, &mut trees[own], &sample, 1);
        let Some(reached) = reached else { continue };
        let target = trees[own].nodes[reached].clone();
        let (met, arrived) = grow(space, &mut trees[other], &target, usize::MAX);
        if let (Some(met), true) = (met, arrived) {
            let ends = if own == 0 { [reached, met] } else { [met, reached] };
            let mut way = trees[0].branch(ends[0]);
            way.reverse();
            way.extend(trees[1].branch(ends[1]).into_iter().skip(1));
            return Some(shortened(space, way, &mut rng));
        }
    }
    None
}

/// Grows the tree from its nearest node towards `target`, at most `steps` steps: the last node added, and whether
/// that is the target.
fn grow(space: &Space, tree: &mut Tree, target: &[f64], steps: usize) -> (Option<usize>, bool) {
    let time = |q: &Vec<f64>| space.robot.joint_time(q, target);
    let nearest = (0..tree.nodes.len())
        .min_by(|&a, &b| time(&tree.nodes[a]).total_cmp(&time(&tree.nodes[b])).then(a.cmp(&b)));
    let Some(mut at) = nearest else { return (None, false) };
    let mut added = None;
    for _ in 0..steps {
        let left = time(&tree.nodes[at]);
        let next = between(&tree.nodes[at], target, (STEP / left).min(1.0));
        if space.blocked(&tree.nodes[at], &next).is_some() {
            return (added, false);
        }
        tree.nodes.push(next);
        tree.parents.push(at);
        at = tree.nodes.len() - 1;
        added = Some(at);
        if left <= STEP {
            return (added, true);
        }
    }
    (added, false)
}

/// A configuration anywhere within the limits; joints that do not move keep their positions.
fn sample(space: &Space, start: &[f64], rng: &mut ChaCha8Rng) -> Vec<f64> {
    let mut q = start.to_vec();
    for &joint in space.moving {
        let [low, high] = sampled_range(space.robot.joints[joint].limits);
        q[joint] = rng.random_range(low..=high);
    }
    q
}

/// Limits, or a turn to either side for a joint without.
pub(crate) fn sampled_range(limits: [f64; 2]) -> [f64; 2] {
    let turn = std::f64::consts::TAU;
    if limits.iter().all(|l| l.is_finite()) { limits } else { [-turn, turn] }
}

/// Cuts corners: two random points of the way joined straight where that is free.
fn shortened(space: &Space, mut way: Vec<Vec<f64>>, rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
    for _ in 0..SHORTCUTS {
        if way.len() < 3 {
            break;
        }
        let mut ends = [0; 2].map(|_| rng.random_range(0.0..(way.len() - 1) as f64));
        ends.sort_by(f64::total_cmp);
        let legs = ends.map(|e| e as usize);
        if legs[0] == legs[1] {
            continue;
        }
        let points =
            [0, 1].map(|i| between(&way[legs[i]], &way[legs[i] + 1], ends[i] - legs[i] as f64));
        if space.blocked(&points[0], &points[1]).is_none() {
            way.splice(legs[0] + 1..=legs[1], points);
        }
    }
    // Corners that are not needed any more.
    let mut at = 1;
    while at + 1 < way.len() {
        if space.blocked(&way[at - 1], &way[at + 1]).is_none() {
            way.remove(at);
        } else {
            at += 1;
        }
    }
    way
}
