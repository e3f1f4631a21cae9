//! Single triangles: their angles, and an exact intersection test of two.
//!
//! Signs of volumes and areas come from Shewchuk's adaptive predicates (Shewchuk 1997, Adaptive
//! Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates), so no answer depends
//! on rounding. Triangles are closed sets: touching counts as intersecting.

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
/// Two triangles that share a point share one that lies on an edge of either. For pairs with a
/// degenerate triangle the answer is conservative: it may be true for two that only come close.
pub fn triangles_intersect(a: &[Vec3; 3], b: &[Vec3; 3]) -> bool {
    !lies_strictly_on_one_side(a, b)
        && !lies_strictly_on_one_side(b, a)
        && (edges(a).any(|[p, q]| segment_intersects_triangle(&p, &q, b))
            || edges(b).any(|[p, q]| segment_intersects_triangle(&p, &q, a)))
}

/// Whether two triangles that have the corner `s` in common, (s, a0, a1) and (s, b0, b1), share
/// another point.
///
/// The common set is a segment from s to where it leaves one of the two triangles, which is through
/// the edge opposite of s.
pub(crate) fn intersect_beyond_shared_vertex(s: &Vec3, a: &[Vec3; 2], b: &[Vec3; 2]) -> bool {
    let first = [*s, a[0], a[1]];
    let second = [*s, b[0], b[1]];
    !is_edge_on_one_side(&first, b)
        && !is_edge_on_one_side(&second, a)
        && (segment_intersects_triangle(&a[0], &a[1], &second)
            || segment_intersects_triangle(&b[0], &b[1], &first))
}

/// Whether both ends of `edge` lie strictly on the same side of the triangle's plane.
fn is_edge_on_one_side(plane: &[Vec3; 3], edge: &[Vec3; 2]) -> bool {
    orient_3d(plane, &edge[0]) * orient_3d(plane, &edge[1]) > 0.0
}

/// Whether two triangles that have the edge u v in common, (u, v, p) and (u, v, q), share a point
/// beside it. They do only if one folds back onto the other in the same plane.
pub(crate) fn overlap_beyond_shared_edge(u: &Vec3, v: &Vec3, p: &Vec3, q: &Vec3) -> bool {
    if orient_3d(&[*u, *v, *p], q) != 0.0 {
        return false;
    }
    // A projection that maps the plane one-to-one preserves the sides; the others give 0.
    let mut on_same_side = false;
    for axis in 0..3 {
        let [u, v, p, q] = [u, v, p, q].map(|x| project(x, axis));
        let sides = orient_2d(u, v, p) * orient_2d(u, v, q);
        if sides < 0.0 {
            return false;
        }
        on_same_side |= sides > 0.0;
    }
    on_same_side || (are_collinear(&[*u, *v, *p]) && are_collinear(&[*u, *v, *q]))
}

/// Whether the corners lie on one line or in one point; the answer is exact.
pub(crate) fn are_collinear(corners: &[Vec3; 3]) -> bool {
    (0..3).all(|axis| {
        let [a, b, c] = [0, 1, 2].map(|i| project(&corners[i], axis));
        orient_2d(a, b, c) == 0.0
    })
}

fn edges(t: &[Vec3; 3]) -> impl Iterator<Item = [Vec3; 2]> {
    let t = *t;
    (0..3).map(move |i| [t[i], t[(i + 1) % 3]])
}

fn lies_strictly_on_one_side(plane: &[Vec3; 3], other: &[Vec3; 3]) -> bool {
    let sides = [0, 1, 2].map(|i| orient_3d(plane, &other[i]));
    sides.iter().all(|&s| s > 0.0) || sides.iter().all(|&s| s < 0.0)
}

fn segment_intersects_triangle(p: &Vec3, q: &Vec3, t: &[Vec3; 3]) -> bool {
    let (at_p, at_q) = (sign(orient_3d(t, p)), sign(orient_3d(t, q)));
    if at_p * at_q > 0 {
        return false;
    }
    if at_p == 0 && at_q == 0 {
        return coplanar_segment_intersects_triangle(p, q, t);
    }
    // The line p q meets the triangle if it passes all three edges on the same side.
    let (mut passes_left, mut passes_right) = (false, false);
    for i in 0..3 {
        match sign(orient_3d(&[*p, *q, t[i]], &t[(i + 1) % 3])) {
            1 => passes_left = true,
            -1 => passes_right = true,
            _ => {}
        }
    }
    !(passes_left && passes_right)
}

/// Projections along the axes keep common points common, and at least one of them is one-to-one on
/// the plane. The sets intersect if and only if they intersect in all three projections.
fn coplanar_segment_intersects_triangle(p: &Vec3, q: &Vec3, t: &[Vec3; 3]) -> bool {
    (0..3).all(|axis| {
        let (p, q) = (project(p, axis), project(q, axis));
        let t = [0, 1, 2].map(|i| project(&t[i], axis));
        is_point_in_triangle(p, &t)
            || is_point_in_triangle(q, &t)
            || (0..3).any(|i| segments_intersect(p, q, t[i], t[(i + 1) % 3]))
    })
}

fn is_point_in_triangle(p: Coord<f64>, t: &[Coord<f64>; 3]) -> bool {
    let signs = [0, 1, 2].map(|i| sign(orient_2d(t[i], t[(i + 1) % 3], p)));
    is_within_range(p.x, t.map(|c| c.x))
        && is_within_range(p.y, t.map(|c| c.y))
        && !(signs.contains(&1) && signs.contains(&-1))
}

fn segments_intersect(a: Coord<f64>, b: Coord<f64>, c: Coord<f64>, d: Coord<f64>) -> bool {
    do_ranges_overlap([a.x, b.x], [c.x, d.x])
        && do_ranges_overlap([a.y, b.y], [c.y, d.y])
        && sign(orient_2d(a, b, c)) * sign(orient_2d(a, b, d)) <= 0
        && sign(orient_2d(c, d, a)) * sign(orient_2d(c, d, b)) <= 0
}

/// Whether `value` lies between the smallest and the largest of `values`.
fn is_within_range(value: f64, values: [f64; 3]) -> bool {
    let low = values[0].min(values[1]).min(values[2]);
    let high = values[0].max(values[1]).max(values[2]);
    low <= value && value <= high
}

/// Whether the intervals between the two pairs of numbers share a number.
fn do_ranges_overlap([a, b]: [f64; 2], [c, d]: [f64; 2]) -> bool {
    a.min(b) <= c.max(d) && c.min(d) <= a.max(b)
}

/// Sign of the volume of the tetrahedron (t, p): the side of the triangle's plane on which p lies.
fn orient_3d(t: &[Vec3; 3], p: &Vec3) -> f64 {
    let [a, b, c, d] = [&t[0], &t[1], &t[2], p].map(|v| Coord3D { x: v.x, y: v.y, z: v.z });
    robust::orient3d(a, b, c, d)
}

/// Sign of the area of the triangle (a, b, c): positive if counter-clockwise.
fn orient_2d(a: Coord<f64>, b: Coord<f64>, c: Coord<f64>) -> f64 {
    robust::orient2d(a, b, c)
}

/// The point without its coordinate along `axis`.
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

    /// The corners in the plane z = x + y.
    fn tilt(corners: [[f64; 3]; 3]) -> [Vec3; 3] {
        corners.map(|[x, y, _]| Vec3::new(x, y, x + y))
    }

    fn edge_in_plane(y0: f64, y1: f64) -> [Vec3; 2] {
        [Vec3::new(1.0, y0, 0.0), Vec3::new(1.0, y1, 0.0)]
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
        assert!(overlap_beyond_shared_edge(&u, &v, &p, &Vec3::new(0.7, 0.3, 0.0)));
        assert!(!overlap_beyond_shared_edge(&u, &v, &p, &Vec3::new(0.7, -0.3, 0.0)));
        assert!(!overlap_beyond_shared_edge(&u, &v, &p, &Vec3::new(0.7, 0.3, 1e-18)));
    }

    #[test]
    fn triangles_at_a_common_corner_may_pierce() {
        let s = Vec3::zeros();
        let a = [Vec3::new(1.0, -1.0, 0.0), Vec3::new(1.0, 1.0, 0.0)];
        let away = [Vec3::new(-1.0, 0.0, -1.0), Vec3::new(-1.0, 0.0, 1.0)];
        let through = [Vec3::new(2.0, 0.0, -1.0), Vec3::new(2.0, 0.0, 1.0)];
        assert!(!intersect_beyond_shared_vertex(&s, &a, &away));
        assert!(intersect_beyond_shared_vertex(&s, &a, &through));
        // In one plane: side by side with a gap, touching along an edge's line, overlapping.
        assert!(!intersect_beyond_shared_vertex(&s, &a, &edge_in_plane(2.0, 3.0)));
        assert!(intersect_beyond_shared_vertex(&s, &a, &edge_in_plane(1.0, 3.0)));
        assert!(intersect_beyond_shared_vertex(&s, &a, &edge_in_plane(0.5, 3.0)));
    }

    #[test]
    fn the_angles_of_a_right_triangle_are_90_and_twice_45_degrees() {
        let angles = triangle_angles(&triangle(FLAT)).map(f64::to_degrees);
        for (angle, expected) in angles.into_iter().zip([90.0, 45.0, 45.0]) {
            assert!((angle - expected).abs() < 1e-12);
        }
    }
}
