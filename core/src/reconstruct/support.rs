//! The plane that the object stands on: it can't be seen, yet it is known, so it counts as surface.

use super::winding::{Winding, areas};
use crate::geometry::{Aabb, Cloud, Vec3};
use rayon::prelude::*;

/// The cloud with points of the support plane z = 0 added at the distance `spacing` (metres) wherever the object
/// stands on it: outward normal -z, no standard deviation, support by 0 scans.
///
/// Together with its mirror image below the plane the object is a closed body, whose winding number tells what of
/// the plane lies inside, however ragged the lower border of the measured points is.
pub(super) fn with_support_plane(cloud: &Cloud, spacing: f64) -> Cloud {
    let mut doubled = cloud.clone();
    for i in 0..cloud.len() {
        let mirrored = |v: &Vec3| Vec3::new(v.x, v.y, -v.z);
        doubled.push(
            mirrored(&cloud.points[i]),
            mirrored(&cloud.normals[i]),
            cloud.sigma[i],
            cloud.support[i],
        );
    }
    let winding = Winding::new(&doubled, &areas(&doubled, spacing), spacing);
    let bounds = Aabb::of(&cloud.points);
    let steps = [0, 1].map(|i| (bounds.extent()[i] / spacing).ceil() as usize);
    let place = |index: usize| {
        let (x, y) = (index % (steps[0] + 1), index / (steps[0] + 1));
        let corner = Vec3::new(bounds.min.x, bounds.min.y, 0.0);
        corner + Vec3::new(x as f64, y as f64, 0.0) * spacing
    };
    let inside: Vec<bool> = (0..(steps[0] + 1) * (steps[1] + 1))
        .into_par_iter()
        .map(|index| winding.at(&place(index)) > 0.5)
        .collect();
    let mut supported = cloud.clone();
    for index in (0..inside.len()).filter(|&i| inside[i]) {
        supported.push(place(index), -Vec3::z(), f64::NAN, 0);
    }
    supported
}
