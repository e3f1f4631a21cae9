//! Nearest-neighbour search over fixed points.

use super::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::num::NonZero;

/// A k-d tree over points that do not change; results carry the index into the slice it was made
/// from.
///
/// Lists of neighbours are ordered by distance, then index, and which of several points at the same
/// distance belong to them does not depend on the layout of the tree.
///
/// ```
/// use puffer_core::geometry::{KdTree, Vec3};
///
/// let tree = KdTree::new(&[Vec3::zeros(), Vec3::x(), Vec3::y() * 3.0]);
/// assert_eq!(tree.nearest(&Vec3::new(0.9, 0.0, 0.0)).map(|(index, _)| index), Some(1));
/// let near = tree.within(&Vec3::zeros(), 1.0);
/// assert_eq!(near, [(0, 0.0), (1, 1.0)]);
/// ```
pub struct KdTree {
    points: Points,
    len: usize,
}

/// How the points are searched.
enum Points {
    Tree(ImmutableKdTree<f64, 3>),
    /// One after another: for no points at all, and for those that no tree can be built of (more
    /// than 32 bits can count).
    List(Vec<[f64; 3]>),
}

impl KdTree {
    /// Builds the tree. Points must be finite.
    pub fn new(points: &[Vec3]) -> KdTree {
        let coordinates: Vec<[f64; 3]> = points.iter().map(coordinates).collect();
        let len = coordinates.len();
        let tree = if len == 0 { None } else { ImmutableKdTree::new_from_slice(&coordinates).ok() };
        KdTree { points: tree.map_or_else(|| Points::List(coordinates), Points::Tree), len }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is no point at all.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// A nearest point: index and squared distance. Which one of several at the same distance is
    /// left open, but it is the same for the same points.
    pub fn nearest(&self, query: &Vec3) -> Option<(usize, f64)> {
        match &self.points {
            Points::Tree(tree) => {
                let query = coordinates(query);
                let found = tree.query(&query).nearest_one::<SquaredEuclidean<f64>>().execute();
                Some((found.item as usize, found.distance))
            }
            Points::List(list) => sorted(distances(list, query)).first().copied(),
        }
    }

    /// A nearest point not farther than `radius`: index and squared distance.
    pub fn nearest_within(&self, query: &Vec3, radius: f64) -> Option<(usize, f64)> {
        self.nearest(query).filter(|(_, square)| *square <= radius * radius)
    }

    /// The `count` nearest points: indices and squared distances, nearest first. Of several points
    /// at the largest distance, those with the smallest indices are taken.
    pub fn nearest_n(&self, query: &Vec3, count: usize) -> Vec<(usize, f64)> {
        let mut found = self.nearest_unordered(query, (count + 1).min(self.len));
        if let [.., last, next] = found.as_slice()
            && found.len() > count
            && last.1 == next.1
        {
            // The tree chose between points at the same distance.
            let square = last.1;
            found = self.within_square(query, square);
        }
        found.truncate(count);
        found
    }

    /// The `count` nearest points, nearest first, chosen by the layout of the tree where distances
    /// are equal.
    fn nearest_unordered(&self, query: &Vec3, count: usize) -> Vec<(usize, f64)> {
        let Some(count) = NonZero::new(count) else { return Vec::new() };
        match &self.points {
            Points::Tree(tree) => sorted(
                tree.query(&coordinates(query))
                    .nearest_n::<SquaredEuclidean<f64>>(count)
                    .execute()
                    .into_iter()
                    .map(|found| (found.item as usize, found.distance))
                    .collect(),
            ),
            Points::List(list) => {
                let mut found = sorted(distances(list, query));
                found.truncate(count.get());
                found
            }
        }
    }

    /// All points not farther than `radius`: indices and squared distances, nearest first.
    pub fn within(&self, query: &Vec3, radius: f64) -> Vec<(usize, f64)> {
        self.within_square(query, radius * radius)
    }

    fn within_square(&self, query: &Vec3, square: f64) -> Vec<(usize, f64)> {
        match &self.points {
            Points::Tree(tree) => sorted(
                tree.query(&coordinates(query))
                    .within::<SquaredEuclidean<f64>>(square)
                    .unsorted()
                    .execute()
                    .into_iter()
                    .map(|found| (found.item as usize, found.distance))
                    .collect(),
            ),
            Points::List(list) => {
                let mut found = sorted(distances(list, query));
                found.retain(|(_, distance)| *distance <= square);
                found
            }
        }
    }
}

fn coordinates(point: &Vec3) -> [f64; 3] {
    [point.x, point.y, point.z]
}

/// Index and squared distance of each point.
fn distances(points: &[[f64; 3]], query: &Vec3) -> Vec<(usize, f64)> {
    let squares = points.iter().map(|point| (Vec3::from(*point) - query).norm_squared());
    squares.enumerate().collect()
}

fn sorted(mut found: Vec<(usize, f64)>) -> Vec<(usize, f64)> {
    found.sort_unstable_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::seq::SliceRandom;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn many_points_on_one_plane_and_duplicates_are_fine() {
        let mut points: Vec<Vec3> =
            (0..2000).map(|i| Vec3::new((i % 50) as f64, (i / 50) as f64, 0.0)).collect();
        points.extend(std::iter::repeat_n(Vec3::new(1.0, 1.0, 0.0), 500));
        let tree = KdTree::new(&points);
        assert_eq!(tree.within(&Vec3::new(1.0, 1.0, 0.0), 0.1).len(), 501);
        assert_eq!(tree.nearest_n(&Vec3::new(10.2, 10.1, 1.0), 5)[0].0, 510);
        assert!(tree.nearest_within(&Vec3::new(0.0, 0.0, 3.0), 2.0).is_none());
    }

    #[test]
    fn an_empty_tree_finds_nothing() {
        let tree = KdTree::new(&[]);
        assert!(tree.is_empty());
        assert!(tree.nearest(&Vec3::zeros()).is_none());
        assert!(tree.nearest_n(&Vec3::zeros(), 3).is_empty());
        assert!(tree.within(&Vec3::zeros(), 3.0).is_empty());
    }

    /// A search that never built a tree.
    fn list(points: &[Vec3]) -> KdTree {
        let list = points.iter().map(coordinates).collect();
        KdTree { points: Points::List(list), len: points.len() }
    }

    /// Points of a coarse lattice in random order, so that many distances are equal.
    fn lattice(count: usize) -> Vec<Vec3> {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        (0..count).map(|_| Vec3::from_fn(|_, _| f64::from(rng.random_range(0..9_i32)))).collect()
    }

    #[test]
    fn neighbours_are_those_of_brute_force_in_the_same_order() {
        let points = lattice(900);
        let (tree, list) = (KdTree::new(&points), list(&points));
        for query in lattice(40).into_iter().map(|p| p + Vec3::new(0.5, 0.0, 0.25)) {
            for count in [1, 2, 7, 40, 900, 1000] {
                assert_eq!(tree.nearest_n(&query, count), list.nearest_n(&query, count));
            }
            for radius in [0.0, 0.6, 1.5, 3.0] {
                assert_eq!(tree.within(&query, radius), list.within(&query, radius));
            }
            let (index, square) = tree.nearest(&query).unwrap();
            assert_eq!(square, list.nearest(&query).unwrap().1);
            assert_eq!(square, (points[index] - query).norm_squared());
        }
    }

    #[test]
    fn of_equally_distant_points_the_first_ones_are_taken_in_any_order_of_the_points() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let ring: Vec<Vec3> = (0..400)
            .map(|i| {
                let signs = [0, 1, 2].map(|bit| if (i >> bit) & 1 == 0 { 1.0 } else { -1.0 });
                // 13 from the origin, whatever the order.
                let mut lengths = [3.0, 4.0, 12.0];
                lengths.rotate_left(i % 3);
                Vec3::from_fn(|k, _| lengths[k] * signs[k])
            })
            .collect();
        for _ in 0..5 {
            let mut points = ring.clone();
            points.shuffle(&mut rng);
            let found = KdTree::new(&points).nearest_n(&Vec3::zeros(), 10);
            let indices: Vec<usize> = found.iter().map(|f| f.0).collect();
            assert_eq!(indices, (0..10).collect::<Vec<_>>());
        }
    }

    #[test]
    fn points_that_no_tree_was_built_of_are_found_all_the_same() {
        let points = [Vec3::x(), Vec3::y() * 2.0, Vec3::z() * 3.0];
        let list = list(&points);
        assert_eq!(list.nearest(&Vec3::zeros()), Some((0, 1.0)));
        assert_eq!(list.nearest_n(&Vec3::zeros(), 2), [(0, 1.0), (1, 4.0)]);
        assert_eq!(list.within(&Vec3::zeros(), 2.0), [(0, 1.0), (1, 4.0)]);
        assert_eq!(list.nearest_within(&Vec3::zeros(), 0.5), None);
    }
}
