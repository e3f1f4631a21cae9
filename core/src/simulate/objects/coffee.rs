//! A vacuum-packed brick of coffee: wrinkled sides, side folds, a folded flap on top. Millimetres.

use super::sdf::{capsule, rounded_box, subtract, union};
use crate::geometry::Vec3;

/// Package of 66 x 91 x 180 mm.
pub(crate) fn coffee(p: &Vec3) -> f64 {
    let body = rounded_box(&(p - Vec3::z() * 86.0), [33.0, 45.5, 86.0], 4.0) + wrinkles(p);
    // Symmetric parts are made once, at positive y.
    let q = Vec3::new(p.x, p.y.abs(), p.z);
    let fold = capsule(&q, [0.0, 47.0, 50.0], [0.0, 46.6, 176.0], 2.2);
    let [tuck_front, tuck_back] =
        [34.0, -34.0].map(|x| capsule(&q, [x, 46.0, 173.0], [0.0, 20.0, 173.0], 1.5));
    let seam = capsule(p, [1.0, -40.0, -0.6], [1.0, 40.0, -0.6], 1.4);
    let folded = [fold, tuck_front, tuck_back, seam]
        .into_iter()
        .fold(body, |solid, crease| subtract(solid, crease, 1.5));
    union(folded, flap(p), 1.5)
}

/// Depth of the wrinkles, 0 to 0.5 mm, below the plain box.
fn wrinkles(p: &Vec3) -> f64 {
    let wave = (0.19 * p.x + 0.11 * p.z).sin() * (0.16 * p.y - 0.09 * p.z + 1.0).sin();
    let fine = (0.31 * p.y + 0.23 * p.z - 0.27 * p.x).sin();
    0.25 + 0.15 * wave + 0.1 * fine
}

/// Two plies of the closed top, folded over to one side and tilted a little.
fn flap(p: &Vec3) -> f64 {
    let (sin, cos) = 0.05f64.sin_cos();
    let [upper, lower] = [Vec3::new(-6.0, 0.0, 175.1), Vec3::new(10.0, 1.0, 172.4)].map(|center| {
        let q = p - center;
        Vec3::new(cos * q.x + sin * q.z, q.y, cos * q.z - sin * q.x)
    });
    let upper = rounded_box(&upper, [15.0, 41.0, 4.2], 1.5);
    let lower = rounded_box(&lower, [14.0, 39.0, 2.6], 1.0);
    union(upper, lower, 1.0)
}
