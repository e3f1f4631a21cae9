//! A bounding volume hierarchy of axis-aligned boxes that finds the boxes which intersect a given
//! one.

use crate::geometry::{Aabb, Vec3};

/// Limit of the items in a leaf. A few boxes side by side are tested faster than two more levels
/// are walked.
const MAX_LEAF_ITEMS: usize = 4;
/// With fewer items a subtree is built in the same thread, because another one costs more than it
/// gains.
const MIN_PARALLEL_ITEMS: usize = 4096;

/// Room for the stack of a query: the depth is the binary logarithm of at most 2^32 items, and each
/// level leaves one sibling on the stack.
const MAX_STACK: usize = 40;

/// A balanced binary tree. The node over `items[low..high]` splits them between its children at the
/// middle of the range.
pub(crate) struct AabbTree {
    /// (item, its box), in tree order.
    items: Vec<(u32, Aabb)>,
    /// Boxes of the inner nodes in pre-order: each node is followed by its left subtree.
    nodes: Vec<Aabb>,
}

impl AabbTree {
    /// Builds the tree over `items`, pairs of an index and its box.
    pub(crate) fn new(mut items: Vec<(u32, Aabb)>) -> AabbTree {
        let mut nodes = vec![Aabb::EMPTY; node_count(items.len())];
        build(&mut items, &mut nodes);
        AabbTree { items, nodes }
    }

    /// Calls `visit` with every item whose box intersects or touches `query`, in tree order.
    pub(crate) fn for_each_intersecting(&self, query: &Aabb, mut visit: impl FnMut(u32)) {
        let mut stack = [(0usize, 0usize, 0usize); MAX_STACK];
        stack[0] = (0, 0, self.items.len());
        let mut stacked = 1;
        while stacked > 0 {
            stacked -= 1;
            let (node, low, high) = stack[stacked];
            if high - low <= MAX_LEAF_ITEMS {
                for (item, aabb) in &self.items[low..high] {
                    if aabb.intersects(query) {
                        visit(*item);
                    }
                }
            } else if self.nodes[node].intersects(query) {
                let middle = (low + high) / 2;
                stack[stacked] = (node + 1 + node_count(middle - low), middle, high);
                stack[stacked + 1] = (node + 1, low, middle);
                stacked += 2;
            }
        }
    }
}

/// Number of inner nodes of a tree over `items` items.
fn node_count(items: usize) -> usize {
    // Splitting at the middle keeps the sizes of all subtrees of a level within one item of each
    // other, so that it is enough to count the subtrees of the two sizes in the last level.
    let mut levels = 0;
    while (items >> levels) > MAX_LEAF_ITEMS {
        levels += 1;
    }
    // All nodes above the last level are inner; in the last level those with more than
    // MAX_LEAF_ITEMS items.
    let nodes = 1usize << levels;
    let larger = items & (nodes - 1);
    (nodes - 1) + if (items >> levels) == MAX_LEAF_ITEMS { larger } else { 0 }
}

/// Sorts `items` into tree order and fills in the boxes of the inner nodes.
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
    let parallel = items.len() > MIN_PARALLEL_ITEMS;
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
            if items <= MAX_LEAF_ITEMS { 0 } else { 1 + slow(items / 2) + slow(items - items / 2) }
        }
        for items in 0..3000 {
            assert_eq!(node_count(items), slow(items), "{items}");
        }
    }

    /// Coordinates from 0 to `scale` in steps of a sixteenth, so that boxes often touch.
    fn random_vector(rng: &mut ChaCha8Rng, scale: f64) -> Vec3 {
        Vec3::from_fn(|_, _| (rng.random::<f64>() * scale * 16.0).floor() / 16.0)
    }

    #[test]
    fn the_boxes_found_are_those_of_a_plain_search() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for count in [0, 1, 4, 5, 300] {
            let boxes: Vec<(u32, Aabb)> = (0..count)
                .map(|i| {
                    let min = random_vector(&mut rng, 10.0);
                    (i, Aabb { min, max: min + random_vector(&mut rng, 2.0) })
                })
                .collect();
            let tree = AabbTree::new(boxes.clone());
            for (_, query) in &boxes {
                let mut found = Vec::new();
                tree.for_each_intersecting(query, |item| found.push(item));
                found.sort_unstable();
                let expected: Vec<u32> =
                    boxes.iter().filter(|(_, b)| b.intersects(query)).map(|(i, _)| *i).collect();
                assert_eq!(found, expected);
            }
        }
    }
}
