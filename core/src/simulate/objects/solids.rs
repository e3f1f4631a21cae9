//! Simple solids, millimetres.

use super::sdf::rounded_box;
use crate::geometry::Vec3;

/// Ball of 100 mm.
pub(crate) fn sphere(p: &Vec3) -> f64 {
    (p - Vec3::z() * 50.0).norm() - 50.0
}

/// Box of 100 x 70 x 50 mm with edges of 1.5 mm.
pub(crate) fn cuboid(p: &Vec3) -> f64 {
    rounded_box(&(p - Vec3::z() * 25.0), [50.0, 35.0, 25.0], 1.5)
}

/// Torus that lies flat, of 110 mm, 30 mm thick.
pub(crate) fn torus(p: &Vec3) -> f64 {
    (p.x.hypot(p.y) - 40.0).hypot(p.z - 15.0) - 15.0
}
