//! Oriented points near each other, separated by the side of the surface that they lie on.

use super::CellIndex;
use crate::geometry::Vec3;

/// Points of one side are thinned if they are nearer to each other than this share of the distance
/// that is asked for: kept points then lie about that distance apart, neither nearer nor much
/// farther.
const MIN_DISTANCE_RATIO: f64 = 0.7;

/// Splits `members` (indices into the unit `normals`) into the sides of a surface. A side is the
/// first member that is left, and all whose normals have at least the cosine `min_cos` to its
/// normal.
pub(crate) fn split_by_side(members: &[u32], normals: &[Vec3], min_cos: f64) -> Vec<Vec<u32>> {
    let mut members = members.to_vec();
    let mut found = Vec::new();
    while let Some(&first) = members.first() {
        let axis = normals[first as usize];
        let (same, others) =
            members.into_iter().partition(|&i| normals[i as usize].dot(&axis) >= min_cos);
        found.push(same);
        members = others;
    }
    found
}

/// Thins oriented points to about `distance` (metres). In the given `order` of indices, a point is
/// kept if no kept point of its side lies near it. Returns the indices of the kept points,
/// ascending.
pub(crate) fn thin_by_distance(
    points: &[Vec3],
    normals: &[Vec3],
    order: &[usize],
    distance: f64,
) -> Vec<usize> {
    let cells = CellIndex::new(points, distance);
    let mut dropped = vec![false; points.len()];
    let mut kept = Vec::new();
    for &i in order {
        if dropped[i] {
            continue;
        }
        kept.push(i);
        cells.for_each_within(points, &points[i], MIN_DISTANCE_RATIO * distance, |j, _| {
            dropped[j] |= normals[j].dot(&normals[i]) > 0.0;
        });
    }
    kept.sort_unstable();
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sides_of_a_thin_wall_are_two_and_keep_their_points() {
        let points: Vec<Vec3> =
            (0..20).map(|i| Vec3::new(f64::from(i / 2) * 0.5, 0.0, 0.01)).collect();
        let normals: Vec<Vec3> =
            (0..20).map(|i| if i % 2 == 0 { Vec3::z() } else { -Vec3::z() }).collect();
        let all: Vec<u32> = (0..20).collect();
        let found = split_by_side(&all, &normals, 0.7);
        assert_eq!(found.iter().map(Vec::len).collect::<Vec<_>>(), [10, 10]);
        assert!(found[1].iter().all(|i| i % 2 == 1));

        let order: Vec<usize> = (0..20).collect();
        // Every second of each side, half a metre apart, is nearer than 0.7 m to the one before.
        let kept = thin_by_distance(&points, &normals, &order, 1.0);
        assert_eq!(kept, [0, 1, 4, 5, 8, 9, 12, 13, 16, 17]);
    }
}
