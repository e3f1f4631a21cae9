//! Oriented points of one place, told apart by the side of the surface that they lie on.

use super::CellIndex;
use crate::geometry::Vec3;

/// Points of one side nearer to each other than this share of the distance wanted are one.
const OVERLAP: f64 = 0.7;

/// Splits `members` (indices into the unit `normals`) into the sides of a surface: the first that is left and all whose
/// normals lie within `cosine` of its own.
pub(crate) fn sides(members: &[u32], normals: &[Vec3], cosine: f64) -> Vec<Vec<u32>> {
    let mut members = members.to_vec();
    let mut found = Vec::new();
    while let Some(&first) = members.first() {
        let axis = normals[first as usize];
        let (same, others) =
            members.into_iter().partition(|&i| normals[i as usize].dot(&axis) >= cosine);
        found.push(same);
        members = others;
    }
    found
}

/// Thins oriented points to about `distance` (metres): in the given order each is kept that no kept one of its side lies
/// close to. Returns the indices of those kept, ascending.
pub(crate) fn keep_apart(
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
        cells.for_each_within(points, &points[i], OVERLAP * distance, |j, _| {
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
        let found = sides(&all, &normals, 0.7);
        assert_eq!(found.iter().map(Vec::len).collect::<Vec<_>>(), [10, 10]);
        assert!(found[1].iter().all(|i| i % 2 == 1));

        let order: Vec<usize> = (0..20).collect();
        // Every second of each side, half a metre apart, is nearer than 0.7 m to the one before.
        let kept = keep_apart(&points, &normals, &order, 1.0);
        assert_eq!(kept, [0, 1, 4, 5, 8, 9, 12, 13, 16, 17]);
    }
}
