//! A bounding-volume tree over boxes, for the question which of them touch a given box.

use crate::geometry::{Aabb, Vec3};

/// Items in a leaf: a few boxes side by side are tested faster than two more levels are walked.
const LEAF: usize = 4;
/// Below this many items another thread costs more than it gains.
const PARALLEL: usize = 4096;

/// A balanced binary tree; the node over `items[low..high]` has its children split at the middle.
pub(crate) struct BoxTree {
    /// (item, its box), in tree order.
    items: Vec<(u32, Aabb)>,
    /// Boxes of the inner nodes, in pre-order; a node over n items is followed by the left subtree.
    nodes: Vec<Aabb>,
}

impl BoxTree {
    /// Builds the tree over `items`, pairs of a number and its box.
    pub(crate) fn new(mut items: Vec<(u32, Aabb)>) -> BoxTree {
        let mut nodes = vec![Aabb::EMPTY; node_count(items.len())];
        build(&mut items, &mut nodes);
        BoxTree { items, nodes }
    }

    /// Calls `found` with every item whose box touches `query`, in tree order.
    pub(crate) fn for_each_touching(&self, query: &Aabb, mut found: impl FnMut(u32)) {
        // Depth is log2 of at most 2^32 items, and each level leaves one sibling waiting.
        let mut stack = [(0usize, 0usize, 0usize); 40];
        stack[0] = (0, 0, self.items.len());
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let (node, low, high) = stack[waiting];
            if high - low <= LEAF {
                for (item, aabb) in &self.items[low..high] {
                    if aabb.intersects(query) {
                        found(*item);
                    }
                }
            } else if self.nodes[node].intersects(query) {
                let middle = (low + high) / 2;
                stack[waiting] = (node + 1 + node_count(middle - low), middle, high);
                stack[waiting + 1] = (node + 1, low, middle);
                waiting += 2;
            }
        }
    }
}

/// Number of inner nodes over `items` items.
fn node_count(items: usize) -> usize {
    // Splitting at the middle keeps all subtrees of a level within one item of each other, so the counts of
    // the two sizes are enough, from the leaves up.
    let mut levels = 0;
    while (items >> levels) > LEAF {
        levels += 1;
    }
    // All nodes above the last level are inner; in the last level those that got more than LEAF items.
    let nodes = 1usize << levels;
    let larger = items & (nodes - 1);
    (nodes - 1) + if (items >> levels) == LEAF { larger } else { 0 }
}

fn build(items: &mut [(u32, Aabb)], nodes: &mut [Aabb]) {
    let Some((node, children)) = nodes.split_first_mut() else { return };
    let mut centers = Aabb::EMPTY;
    for (_, aabb) in items.iter() {
        node.insert(&aabb.min);
        node.insert(&aabb.max);
        centers.insert(&doubled_center(aabb));
    }
    let axis = centers.extent().imax();
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| {
        let (x, y) = (doubled_center(&a.1)[axis], doubled_center(&b.1)[axis]);
        x.total_cmp(&y).then(a.0.cmp(&b.0))
    });
    let parallel = items.len() > PARALLEL;
    let (left, right) = items.split_at_mut(middle);
    let (left_nodes, right_nodes) = children.split_at_mut(node_count(middle));
    if parallel {
        rayon::join(|| build(left, left_nodes), || build(right, right_nodes));
    } else {
        build(left, left_nodes);
        build(right, right_nodes);
    }
}

fn doubled_center(aabb: &Aabb) -> Vec3 {
    aabb.min + aabb.max
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_nodes_are_counted_as_they_are_built() {
        fn slow(items: usize) -> usize {
            if items <= LEAF { 0 } else { 1 + slow(items / 2) + slow(items - items / 2) }
        }
        for items in 0..3000 {
            assert_eq!(node_count(items), slow(items), "{items}");
        }
    }

    #[test]
    fn the_boxes_found_are_those_of_a_plain_search() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut vector =
            |scale: f64| Vec3::from_fn(|_, _| (rng.random::<f64>() * scale * 16.0).floor() / 16.0);
        for count in [0, 1, 4, 5, 300] {
            let boxes: Vec<(u32, Aabb)> = (0..count)
                .map(|i| {
                    let min = vector(10.0);
                    (i, Aabb { min, max: min + vector(2.0) })
                })
                .collect();
            let tree = BoxTree::new(boxes.clone());
            for (_, query) in &boxes {
                let mut found = Vec::new();
                tree.for_each_touching(query, |item| found.push(item));
                found.sort_unstable();
                let expected: Vec<u32> =
                    boxes.iter().filter(|(_, b)| b.intersects(query)).map(|(i, _)| *i).collect();
                assert_eq!(found, expected);
            }
        }
    }
}
