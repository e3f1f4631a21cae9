//! Which points of a scan lie at its border: beyond them the surface goes on unseen, so that a closest point there says
//! nothing about where along the surface it belongs (Turk & Levoy 1994, §5).

use crate::geometry::{Vec3, any_orthogonal};
use crate::voxel::CellIndex;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// A point whose neighbours leave a gap of this angle about it lies at the border: the angle criterion of Bendels,
/// Schnabel & Klein 2006, Detecting Holes in Point Set Surfaces, §4.1. On a straight border the gap is pi.
const GAP: f64 = 0.75 * PI;
/// Neighbours are looked for within this many distances between points.
const REACH: f64 = 2.5;

/// Whether each point lies at the border of the surface that the oriented points sample; `spacing` is the distance
/// between them, metres.
pub(crate) fn boundary(points: &[Vec3], normals: &[Vec3], spacing: f64) -> Vec<bool> {
    let radius = REACH * spacing;
    let cells = CellIndex::new(points, radius);
    let at_border = |i: usize| {
        let u = any_orthogonal(&normals[i]);
        let v = normals[i].cross(&u);
        let mut angles = Vec::with_capacity(32);
        cells.for_each_within(points, &points[i], radius, |j, _| {
            let away = points[j] - points[i];
            if j != i && normals[j].dot(&normals[i]) > 0.0 {
                angles.push(away.dot(&v).atan2(away.dot(&u)));
            }
        });
        largest_gap(&mut angles) > GAP
    };
    (0..points.len()).into_par_iter().map(at_border).collect()
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
        let place = |i: usize| (i % 30, i / 30);
        let hole = |(x, y): (usize, usize)| (12..18).contains(&x) && (12..18).contains(&y);
        let kept: Vec<(usize, usize)> = (0..900).map(place).filter(|p| !hole(*p)).collect();
        let points: Vec<Vec3> =
            kept.iter().map(|&(x, y)| Vec3::new(x as f64, y as f64, 0.0)).collect();
        let found = boundary(&points, &vec![Vec3::z(); points.len()], 1.0);
        for (&(x, y), &flag) in kept.iter().zip(&found) {
            let outer = x == 0 || y == 0 || x == 29 || y == 29;
            let beside = |a: usize, b: usize| (13..17).contains(&a) && (b == 11 || b == 18);
            let near = (11..19).contains(&x) && (11..19).contains(&y);
            if outer || beside(x, y) || beside(y, x) {
                assert!(flag, "{x} {y}");
            } else if !near {
                assert!(!flag, "{x} {y}");
            }
        }
    }

    #[test]
    fn a_lone_point_is_a_border() {
        assert_eq!(boundary(&[Vec3::zeros()], &[Vec3::z()], 1.0), [true]);
    }
}
