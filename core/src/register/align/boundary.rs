//! Which points of a scan lie at its border: beyond them the surface goes on unseen, so that a
//! closest point there says nothing about where along the surface it belongs (Turk & Levoy 1994,
//! §5).

use crate::geometry::{Vec3, any_orthogonal};
use crate::voxel::CellIndex;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// A point whose neighbours leave a gap of this angle about it lies at the border: the angle
/// criterion of Bendels, Schnabel & Klein 2006, Detecting Holes in Point Set Surfaces, §4.1. On a
/// straight border the gap is pi.
const MAX_NEIGHBOUR_GAP_RAD: f64 = 0.75 * PI;
/// Radius within which neighbours are searched, in distances between points: it holds about twenty.
const NEIGHBOUR_RADIUS_RATIO: f64 = 2.5;
/// Room for the neighbours of a point, so that the list rarely has to grow.
const NEIGHBOUR_CAPACITY: usize = 32;

/// Whether each point lies at the border of the surface that the oriented points sample; `spacing`
/// is the distance between them, metres.
pub(crate) fn find_boundary(points: &[Vec3], normals: &[Vec3], spacing: f64) -> Vec<bool> {
    let radius = NEIGHBOUR_RADIUS_RATIO * spacing;
    let cells = CellIndex::new(points, radius);
    (0..points.len())
        .into_par_iter()
        .map(|i| {
            let mut angles = neighbour_angles(points, normals, &cells, radius, i);
            largest_gap(&mut angles) > MAX_NEIGHBOUR_GAP_RAD
        })
        .collect()
}

/// Directions in which the neighbours of point `i` on its side of the surface lie, as angles in the
/// tangent plane, radians.
fn neighbour_angles(
    points: &[Vec3],
    normals: &[Vec3],
    cells: &CellIndex,
    radius: f64,
    i: usize,
) -> Vec<f64> {
    let u = any_orthogonal(&normals[i]);
    let v = normals[i].cross(&u);
    let mut angles = Vec::with_capacity(NEIGHBOUR_CAPACITY);
    cells.for_each_within(points, &points[i], radius, |j, _| {
        let away = points[j] - points[i];
        if j != i && normals[j].dot(&normals[i]) > 0.0 {
            angles.push(away.dot(&v).atan2(away.dot(&u)));
        }
    });
    angles
}

/// The largest angle between directions that follow each other round the circle, radians.
fn largest_gap(angles: &mut [f64]) -> f64 {
    angles.sort_unstable_by(f64::total_cmp);
    let (Some(first), Some(last)) = (angles.first(), angles.last()) else { return TAU };
    let around = first + TAU - last;
    angles.windows(2).map(|pair| pair[1] - pair[0]).fold(around, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rim_of_a_plate_with_a_hole_is_found_and_nothing_else() {
        let hole = 12..18;
        let kept: Vec<(usize, usize)> = (0..900)
            .map(|i| (i % 30, i / 30))
            .filter(|(x, y)| !(hole.contains(x) && hole.contains(y)))
            .collect();
        let points: Vec<Vec3> =
            kept.iter().map(|&(x, y)| Vec3::new(x as f64, y as f64, 0.0)).collect();
        let found = find_boundary(&points, &vec![Vec3::z(); points.len()], 1.0);
        for (&(x, y), &flag) in kept.iter().zip(&found) {
            let outer = x == 0 || y == 0 || x == 29 || y == 29;
            let near = (11..19).contains(&x) && (11..19).contains(&y);
            if outer || lies_beside_hole(x, y) || lies_beside_hole(y, x) {
                assert!(flag, "{x} {y}");
            } else if !near {
                assert!(!flag, "{x} {y}");
            }
        }
    }

    fn lies_beside_hole(along: usize, across: usize) -> bool {
        (13..17).contains(&along) && (across == 11 || across == 18)
    }

    #[test]
    fn a_lone_point_is_a_border() {
        assert_eq!(find_boundary(&[Vec3::zeros()], &[Vec3::z()], 1.0), [true]);
    }
}
