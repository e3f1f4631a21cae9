//! Machine parts and the phantom, millimetres.

use super::sdf::{cylinder, extrude, fold_angle, intersect, rounded_box, subtract, union};
use crate::geometry::Vec3;

/// L-shaped bracket of 100 x 50 x 80 mm, 8 mm thick, with a gusset and four through holes (genus
/// 4).
pub(crate) fn bracket(p: &Vec3) -> f64 {
    let block = rounded_box(&(p - Vec3::z() * 40.0), [50.0, 25.0, 40.0], 1.0);
    // The inner corner of the L is rounded to 6 mm.
    let corner = rounded_box(&(p - Vec3::new(58.0, 0.0, 108.0)), [100.0, 100.0, 100.0], 6.0);
    let slope = (p.x + 42.0 + p.z - 8.0 - 34.0) / 2f64.sqrt();
    let legs = (-46.0 - p.x).max(4.0 - p.z);
    let gusset = intersect(intersect(slope, p.y.abs() - 3.5, 1.0), legs, 1.0);
    let solid = union(subtract(block, corner, 1.0), gusset, 2.0);
    let q = Vec3::new(p.x, p.y.abs(), p.z);
    let base_hole = (q.x - 28.0).hypot(q.y - 13.0) - 5.0;
    let wall_hole = ((q.y - 13.0).hypot(q.z - 58.0) - 4.5).max(p.x);
    subtract(subtract(solid, base_hole, 1.2), wall_hole, 1.2)
}

/// Gear of 80 x 80 x 25 mm with 20 teeth, hub, bore and keyway (genus 1).
pub(crate) fn gear(p: &Vec3) -> f64 {
    let q = fold_angle(p, 20.0);
    let flank = (q.y.abs() - 2.9 + 0.3 * (q.x - 37.0)) / 1.09f64.sqrt();
    let tooth = intersect(flank.max(30.0 - q.x), q.x - 40.0, 0.8);
    let flat = union(p.x.hypot(p.y) - 34.0, tooth, 1.5);
    let wheel = union(extrude(flat, p.z, 0.0, 15.0, 0.7), cylinder(p, 16.0, 5.0, 25.0, 1.0), 3.0);
    let keyway = rounded_box(&(p - Vec3::new(8.0, 0.0, 12.0)), [3.0, 2.0, 40.0], 0.5);
    let bore = union(p.x.hypot(p.y) - 8.0, keyway, 0.6);
    subtract(wheel, bore, 1.0)
}

/// Neck-and-cap phantom of 60 x 60 x 84 mm: a ball and a cap, joined by a neck 6 mm thick and 10 mm
/// long.
pub(crate) fn phantom(p: &Vec3) -> f64 {
    let ball = (p - Vec3::z() * 30.0).norm() - 30.0;
    let neck = cylinder(p, 3.0, 52.0, 76.0, 0.5);
    let cap = cylinder(p, 16.0, 70.0, 84.0, 2.0);
    union(union(ball, neck, 1.5), cap, 1.5)
}
