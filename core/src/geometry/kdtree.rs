//! Nearest-neighbour search over fixed points.

use super::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::num::NonZero;

/// A k-d tree over points that do not change; results carry the index into the slice it was made from.
///
/// All answers are ordered by distance, then index, so that they do not depend on the tree's layout.
pub struct KdTree {
    tree: Option<ImmutableKdTree<f64, 3>>,
    len: usize,
}

impl KdTree {
    /// Builds the tree. Points must be finite.
    pub fn new(points: &[Vec3]) -> KdTree {
        let entries: Vec<[f64; 3]> = points.iter().map(|p| [p.x, p.y, p.z]).collect();
        let tree =
            if entries.is_empty() { None } else { ImmutableKdTree::new_from_slice(&entries).ok() };
        KdTree { tree, len: points.len() }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is no point at all.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The nearest point: index and squared distance.
    pub fn nearest(&self, query: &Vec3) -> Option<(usize, f64)> {
        let found =
            self.tree.as_ref()?.query(&key(query)).nearest_one::<SquaredEuclidean<f64>>().execute();
        Some((found.item as usize, found.distance))
    }

    /// The nearest point not farther than `radius`: index and squared distance.
    pub fn nearest_within(&self, query: &Vec3, radius: f64) -> Option<(usize, f64)> {
        self.nearest(query).filter(|(_, square)| *square <= radius * radius)
    }

    /// The `count` nearest points: indices and squared distances, nearest first.
    pub fn nearest_n(&self, query: &Vec3, count: usize) -> Vec<(usize, f64)> {
        let (Some(tree), Some(count)) = (&self.tree, NonZero::new(count.min(self.len))) else {
            return Vec::new();
        };
        sorted(
            tree.query(&key(query))
                .nearest_n::<SquaredEuclidean<f64>>(count)
                .execute()
                .into_iter()
                .map(|found| (found.item as usize, found.distance))
                .collect(),
        )
    }

    /// All points not farther than `radius`: indices and squared distances, nearest first.
    pub fn within(&self, query: &Vec3, radius: f64) -> Vec<(usize, f64)> {
        let Some(tree) = &self.tree else { return Vec::new() };
        sorted(
            tree.query(&key(query))
                .within::<SquaredEuclidean<f64>>(radius * radius)
                .unsorted()
                .execute()
                .into_iter()
                .map(|found| (found.item as usize, found.distance))
                .collect(),
        )
    }
}

fn key(point: &Vec3) -> [f64; 3] {
    [point.x, point.y, point.z]
}

fn sorted(mut found: Vec<(usize, f64)>) -> Vec<(usize, f64)> {
    found.sort_unstable_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    found
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
