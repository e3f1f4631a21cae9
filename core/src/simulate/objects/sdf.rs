//! Signed distances of simple solids and the ways to blend them (Quilez, "Distance functions"), in
//! millimetres; negative is inside. Blends bend distances a little, which the mesher's Newton steps
//! undo.

use crate::geometry::Vec3;

/// A solid as its (nearly) signed distance, millimetres.
pub(crate) type Field = fn(&Vec3) -> f64;

/// Union with a fillet of about the width `k` where the surfaces meet. Surfaces that coincide bulge
/// by k/4.
pub(crate) fn union(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - h * h * k / 4.0
}

/// What is in both, with the common edge rounded over about the width `k`.
pub(crate) fn intersect(a: f64, b: f64, k: f64) -> f64 {
    -union(-a, -b, k)
}

/// What is in `a` but not in `b`, with the common edge rounded over about the width `k`.
pub(crate) fn subtract(a: f64, b: f64, k: f64) -> f64 {
    intersect(a, -b, k)
}

/// Box round the origin with half edges `half` and edges rounded to `radius`.
pub(crate) fn rounded_box(p: &Vec3, half: [f64; 3], radius: f64) -> f64 {
    let q = p.abs() - Vec3::from(half).add_scalar(-radius);
    q.sup(&Vec3::zeros()).norm() + q.max().min(0.0) - radius
}

/// The flat shape of signed distance `flat`, extruded over z in `from..to` with edges rounded to
/// `radius`.
pub(crate) fn extrude(flat: f64, z: f64, from: f64, to: f64, radius: f64) -> f64 {
    let across = flat + radius;
    let along = (z - (from + to) / 2.0).abs() - (to - from) / 2.0 + radius;
    across.max(0.0).hypot(along.max(0.0)) + across.max(along).min(0.0) - radius
}

/// Cylinder round the z axis over z in `from..to` with edges rounded to `rounding`.
pub(crate) fn cylinder(p: &Vec3, radius: f64, from: f64, to: f64, rounding: f64) -> f64 {
    extrude(p.x.hypot(p.y) - radius, p.z, from, to, rounding)
}

/// All points within `radius` of the segment from `a` to `b`.
pub(crate) fn capsule(p: &Vec3, a: [f64; 3], b: [f64; 3], radius: f64) -> f64 {
    let (from, along) = (p - Vec3::from(a), Vec3::from(b) - Vec3::from(a));
    let t = (from.dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
    (from - along * t).norm() - radius
}

/// Turns the point round the z axis into the sector of width 2 pi / `count` about the x axis.
pub(crate) fn fold_angle(p: &Vec3, count: f64) -> Vec3 {
    let sector = std::f64::consts::TAU / count;
    let angle = p.y.atan2(p.x);
    let folded = angle - sector * (angle / sector).round();
    let radius = p.x.hypot(p.y);
    Vec3::new(radius * folded.cos(), radius * folded.sin(), p.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_of_simple_solids_are_exact() {
        let p = Vec3::new(13.0, 4.0, 0.0);
        assert!((rounded_box(&p, [10.0, 10.0, 10.0], 2.0) - 3.0).abs() < 1e-12);
        assert!((cylinder(&Vec3::new(6.0, 8.0, 25.0), 7.0, 0.0, 21.0, 0.0) - 5.0).abs() < 1e-12);
        assert!((capsule(&p, [10.0, 0.0, 0.0], [-10.0, 0.0, 0.0], 1.0) - 4.0).abs() < 1e-12);
    }

    #[test]
    fn blends_meet_the_plain_set_operations_away_from_the_seam() {
        assert_eq!(union(1.0, 4.0, 2.0), 1.0);
        assert_eq!(subtract(-5.0, 1.0, 2.0), -1.0);
        assert!(union(0.0, 0.0, 2.0) < 0.0 && intersect(0.0, 0.0, 2.0) > 0.0);
    }

    #[test]
    fn folding_keeps_radius_and_stays_in_the_sector() {
        let folded = fold_angle(&Vec3::new(-3.0, 4.0, 2.0), 8.0);
        assert!((folded.xy().norm() - 5.0).abs() < 1e-12 && folded.z == 2.0);
        assert!(folded.y.atan2(folded.x).abs() <= std::f64::consts::PI / 8.0 + 1e-12);
    }
}
