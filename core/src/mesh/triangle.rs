//! Single triangles: angles, and an exact test of two for intersection.
//!
//! Signs of volumes and areas come from Shewchuk's adaptive predicates (Shewchuk 1997, Adaptive Precision
//! Floating-Point Arithmetic and Fast Robust Geometric Predicates), so no answer depends on rounding.
//! Triangles are closed sets: touching counts as intersecting.

use crate::geometry::Vec3;
use robust::{Coord, Coord3D};

/// The angles at the three corners, radians; they sum to pi unless the triangle is degenerate.
pub fn triangle_angles(corners: &[Vec3; 3]) -> [f64; 3] {
    std::array::from_fn(|i| {
        let u = corners[(i + 1) % 3] - corners[i];
        let v = corners[(i + 2) % 3] - corners[i];
        u.cross(&v).norm().atan2(u.dot(&v))
    })
}

/// Whether two triangles share at least one point, exactly (they may be degenerate).
///
/// Two triangles that share a point share one on an edge of either. For a pair in which a degenerate triangle
/// is involved the answer is conservative: it may be true for two that only come close.
pub fn triangles_intersect(a: &[Vec3; 3], b: &[Vec3; 3]) -> bool {
    !strictly_on_one_side(a, b)
        && !strictly_on_one_side(b, a)
        && (edges(a).any(|[p, q]| segment_meets_triangle(&p, &q, b))
            || edges(b).any(|[p, q]| segment_meets_triangle(&p, &q, a)))
}

/// Whether two triangles that have the corner `s` in common, (s, a0, a1) and (s, b0, b1), share another point.
///
/// From s the common set runs to where it leaves one of the two, and from s that is through the opposite edge.
pub(crate) fn meet_beyond_corner(s: &Vec3, a: &[Vec3; 2], b: &[Vec3; 2]) -> bool {
    let first = [*s, a[0], a[1]];
    let second = [*s, b[0], b[1]];
    let apart = |plane: &[Vec3; 3], edge: &[Vec3; 2]| {
        volume(plane, &edge[0]) * volume(plane, &edge[1]) > 0.0
    };
    !apart(&first, b)
        && !apart(&second, a)
        && (segment_meets_triangle(&a[0], &a[1], &second)
            || segment_meets_triangle(&b[0], &b[1], &first))
}

/// Whether two triangles that have the edge u v in common, (u, v, p) and (u, v, q), share a point beside it:
/// only if one folds back onto the other in its plane.
pub(crate) fn meet_beyond_edge(u: &Vec3, v: &Vec3, p: &Vec3, q: &Vec3) -> bool {
    if volume(&[*u, *v, *p], q) != 0.0 {
        return false;
    }
    // In each projection that keeps the plane's points apart the sides are the true ones; the others give 0.
    let mut same = false;
    for axis in 0..3 {
        let [u, v, p, q] = [u, v, p, q].map(|x| project(x, axis));
        let sides = area(u, v, p) * area(u, v, q);
        if sides < 0.0 {
            return false;
        }
        same |= sides > 0.0;
    }
    same || (collinear(&[*u, *v, *p]) && collinear(&[*u, *v, *q]))
}

/// Whether the corners lie on one line or in one point, exactly.
pub(crate) fn collinear(corners: &[Vec3; 3]) -> bool {
    (0..3).all(|axis| {
        let [a, b, c] = [0, 1, 2].map(|i| project(&corners[i], axis));
        area(a, b, c) == 0.0
    })
}

fn edges(t: &[Vec3; 3]) -> impl Iterator<Item = [Vec3; 2]> {
    let t = *t;
    (0..3).map(move |i| [t[i], t[(i + 1) % 3]])
}

fn strictly_on_one_side(plane: &[Vec3; 3], other: &[Vec3; 3]) -> bool {
    let sides = [0, 1, 2].map(|i| volume(plane, &other[i]));
    sides.iter().all(|&s| s > 0.0) || sides.iter().all(|&s| s < 0.0)
}

fn segment_meets_triangle(p: &Vec3, q: &Vec3, t: &[Vec3; 3]) -> bool {
    let (at_p, at_q) = (sign(volume(t, p)), sign(volume(t, q)));
    if at_p * at_q > 0 {
        return false;
    }
    if at_p == 0 && at_q == 0 {
        return coplanar_segment_meets_triangle(p, q, t);
    }
    // The line p q passes all three edges on the same side.
    let mut seen = [false; 3];
    for i in 0..3 {
        seen[(1 + sign(volume(&[*p, *q, t[i]], &t[(i + 1) % 3]))) as usize] = true;
    }
    !(seen[0] && seen[2])
}

/// A projection along an axis keeps common points common, and is one-to-one on the plane for at least one axis,
/// so that the sets meet if and only if they meet in all three projections.
fn coplanar_segment_meets_triangle(p: &Vec3, q: &Vec3, t: &[Vec3; 3]) -> bool {
    (0..3).all(|axis| {
        let (p, q) = (project(p, axis), project(q, axis));
        let t = [0, 1, 2].map(|i| project(&t[i], axis));
        point_in_triangle(p, &t)
            || point_in_triangle(q, &t)
            || (0..3).any(|i| segments_meet(p, q, t[i], t[(i + 1) % 3]))
    })
}

fn point_in_triangle(p: Coord<f64>, t: &[Coord<f64>; 3]) -> bool {
    let inside_box = |get: fn(&Coord<f64>) -> f64| {
        let values = t.each_ref().map(get);
        let (low, high) =
            (values[0].min(values[1]).min(values[2]), values[0].max(values[1]).max(values[2]));
        low <= get(&p) && get(&p) <= high
    };
    let signs = [0, 1, 2].map(|i| sign(area(t[i], t[(i + 1) % 3], p)));
    inside_box(|c| c.x) && inside_box(|c| c.y) && !(signs.contains(&1) && signs.contains(&-1))
}

fn segments_meet(a: Coord<f64>, b: Coord<f64>, c: Coord<f64>, d: Coord<f64>) -> bool {
    let overlap = |a: f64, b: f64, c: f64, d: f64| a.min(b) <= c.max(d) && c.min(d) <= a.max(b);
    overlap(a.x, b.x, c.x, d.x)
        && overlap(a.y, b.y, c.y, d.y)
        && sign(area(a, b, c)) * sign(area(a, b, d)) <= 0
        && sign(area(c, d, a)) * sign(area(c, d, b)) <= 0
}

fn volume(t: &[Vec3; 3], p: &Vec3) -> f64 {
    let [a, b, c, d] = [&t[0], &t[1], &t[2], p].map(|v| Coord3D { x: v.x, y: v.y, z: v.z });
    robust::orient3d(a, b, c, d)
}

fn area(a: Coord<f64>, b: Coord<f64>, c: Coord<f64>) -> f64 {
    robust::orient2d(a, b, c)
}

fn project(v: &Vec3, axis: usize) -> Coord<f64> {
    Coord { x: v[(axis + 1) % 3], y: v[(axis + 2) % 3] }
}

fn sign(value: f64) -> i8 {
    i8::from(value > 0.0) - i8::from(value < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLAT: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    fn triangle(corners: [[f64; 3]; 3]) -> [Vec3; 3] {
        corners.map(Vec3::from)
    }

    fn meets_flat(corners: [[f64; 3]; 3]) -> bool {
        let (a, b) = (triangle(FLAT), triangle(corners));
        assert_eq!(triangles_intersect(&a, &b), triangles_intersect(&b, &a));
        triangles_intersect(&a, &b)
    }

    #[test]
    fn piercing_touching_and_missing_are_told_apart() {
        // Pierces; misses by one unit in the last place; touches with a corner; corner on an edge.
        assert!(meets_flat([[0.2, 0.2, -1.0], [0.2, 0.2, 1.0], [5.0, 5.0, 1.0]]));
        let next_up = f64::from_bits(1);
        assert!(meets_flat([[0.2, 0.2, 0.0], [0.2, 0.2, 1.0], [0.3, 0.2, 1.0]]));
        assert!(!meets_flat([[0.2, 0.2, next_up], [0.2, 0.2, 1.0], [0.3, 0.2, 1.0]]));
        assert!(meets_flat([[0.5, 0.5, 0.0], [1.0, 1.0, 1.0], [1.0, 1.0, -1.0]]));
        let beyond = 0.5 + f64::EPSILON;
        assert!(!meets_flat([[0.5, beyond, 0.0], [1.0, 1.0, 1.0], [1.0, 1.0, -1.0]]));
    }

    #[test]
    fn coplanar_triangles_meet_only_where_they_overlap_or_touch() {
        assert!(meets_flat([[0.1, 0.1, 0.0], [0.2, 0.1, 0.0], [0.1, 0.2, 0.0]]));
        assert!(meets_flat([[-1.0, 0.3, 0.0], [2.0, 0.3, 0.0], [2.0, 0.4, 0.0]]));
        assert!(meets_flat([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0]]));
        assert!(!meets_flat([[1.1, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0]]));
        assert!(!meets_flat([[0.6, 0.6, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0]]));
        // A tilted plane, shifted by a power of two so that no rounding occurs.
        let tilt = |c: [[f64; 3]; 3]| c.map(|[x, y, _]| Vec3::new(x, y, x + y));
        let inner = tilt([[0.25, 0.25, 0.0], [0.5, 0.25, 0.0], [0.25, 0.5, 0.0]]);
        let outer = tilt([[1.25, 0.25, 0.0], [1.5, 0.25, 0.0], [1.25, 0.5, 0.0]]);
        assert!(triangles_intersect(&tilt(FLAT), &inner));
        assert!(!triangles_intersect(&tilt(FLAT), &outer));
    }

    #[test]
    fn a_degenerate_triangle_meets_as_the_segment_that_it_is() {
        assert!(meets_flat([[0.2, 0.2, -1.0], [0.2, 0.2, 0.5], [0.2, 0.2, 1.0]]));
        assert!(!meets_flat([[1.2, 0.2, -1.0], [1.2, 0.2, 0.5], [1.2, 0.2, 1.0]]));
    }

    #[test]
    fn a_fold_onto_the_neighbour_counts_but_a_flat_neighbour_does_not() {
        let [u, v, p] = triangle([[0.0; 3], [1.0, 0.0, 0.0], [0.5, 1.0, 0.0]]);
        assert!(meet_beyond_edge(&u, &v, &p, &Vec3::new(0.7, 0.3, 0.0)));
        assert!(!meet_beyond_edge(&u, &v, &p, &Vec3::new(0.7, -0.3, 0.0)));
        assert!(!meet_beyond_edge(&u, &v, &p, &Vec3::new(0.7, 0.3, 1e-18)));
    }

    #[test]
    fn triangles_at_a_common_corner_may_pierce() {
        let s = Vec3::zeros();
        let a = [Vec3::new(1.0, -1.0, 0.0), Vec3::new(1.0, 1.0, 0.0)];
        let away = [Vec3::new(-1.0, 0.0, -1.0), Vec3::new(-1.0, 0.0, 1.0)];
        let through = [Vec3::new(2.0, 0.0, -1.0), Vec3::new(2.0, 0.0, 1.0)];
        assert!(!meet_beyond_corner(&s, &a, &away));
        assert!(meet_beyond_corner(&s, &a, &through));
        // In one plane: side by side with a gap, touching along an edge's line, overlapping.
        let flat = |y0: f64, y1: f64| [Vec3::new(1.0, y0, 0.0), Vec3::new(1.0, y1, 0.0)];
        assert!(!meet_beyond_corner(&s, &a, &flat(2.0, 3.0)));
        assert!(meet_beyond_corner(&s, &a, &flat(1.0, 3.0)));
        assert!(meet_beyond_corner(&s, &a, &flat(0.5, 3.0)));
    }

    #[test]
    fn the_angles_of_a_right_triangle_are_90_and_twice_45_degrees() {
        let angles = triangle_angles(&triangle(FLAT)).map(f64::to_degrees);
        for (angle, expected) in angles.into_iter().zip([90.0, 45.0, 45.0]) {
            assert!((angle - expected).abs() < 1e-12);
        }
    }
}
