//! Hollow things, millimetres.

use super::sdf::{cylinder, intersect, rounded_box, subtract, union};
use crate::geometry::Vec3;

/// Mug of 107.5 x 80 x 95 mm with a wall of 4 mm; its handle makes it genus 1.
pub(crate) fn mug(p: &Vec3) -> f64 {
    // Measured along x the handle reaches farther than the cup, so the cup stands off the middle.
    let p = &(p + Vec3::x() * 13.75);
    let outside = cylinder(p, 40.0, 0.0, 95.0, 2.0);
    let cavity = cylinder(p, 36.0, 6.0, 130.0, 6.0);
    let foot = cylinder(p, 32.0, -10.0, 1.5, 1.0);
    let with_handle = union(outside, handle(&(p - Vec3::new(40.0, 0.0, 49.0))), 4.0);
    subtract(subtract(with_handle, cavity, 2.0), foot, 1.5)
}

/// A ring of 11 mm tube in the xz plane, 10 mm longer upwards and downwards than a circle.
fn handle(p: &Vec3) -> f64 {
    let z = p.z - p.z.clamp(-10.0, 10.0);
    (p.x.hypot(z) - 22.0).hypot(p.y) - 5.5
}

/// Open box of 80 x 60 x 50 mm with walls of 2 mm.
pub(crate) fn open_box(p: &Vec3) -> f64 {
    let outside = rounded_box(&(p - Vec3::z() * 40.0), [40.0, 30.0, 40.0], 2.0);
    let cavity = rounded_box(&(p - Vec3::z() * 52.0), [38.0, 28.0, 50.0], 1.5);
    intersect(subtract(outside, cavity, 0.6), p.z - 50.0, 0.6)
}
