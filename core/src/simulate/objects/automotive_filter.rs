//! An automotive filter: ribbed body, thin neck, small cylinder on top. Millimetres.

use super::sdf::{capsule, cylinder, fold_angle, subtract, union};
use crate::geometry::Vec3;

/// Filter of 82 x 80 x 103 mm; its neck is 12 mm thick and 12 mm long.
pub(crate) fn filter(p: &Vec3) -> f64 {
    let body = cylinder(p, 38.5, 0.0, 76.0, 3.0);
    let crimp = cylinder(p, 39.5, 3.0, 8.0, 1.0);
    let rib = capsule(&fold_angle(p, 24.0), [38.2, 0.0, 14.0], [38.2, 0.0, 64.0], 1.8);
    // Two stronger ribs, which make the object 82 mm wide.
    let sides = Vec3::new(p.x.abs(), p.y, p.z);
    let lug = capsule(&sides, [38.2, 0.0, 14.0], [38.2, 0.0, 64.0], 2.8);
    let ribbed = union(union(union(body, crimp, 0.8), rib, 1.2), lug, 1.2);
    let neck = cylinder(p, 6.0, 70.0, 95.0, 0.5);
    union(union(ribbed, neck, 2.0), top(p), 2.0)
}

/// The small cylinder, with four grip grooves and a dimple.
fn top(p: &Vec3) -> f64 {
    let cap = cylinder(p, 15.0, 88.0, 103.0, 1.5);
    let groove = capsule(&fold_angle(p, 4.0), [16.0, 0.0, 85.0], [16.0, 0.0, 106.0], 2.5);
    let dimple = (p - Vec3::new(5.0, 0.0, 106.0)).norm() - 5.0;
    subtract(subtract(cap, groove, 1.0), dimple, 1.0)
}
