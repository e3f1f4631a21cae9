//! The plane that the object stands on: it cannot be measured, but it is known, and counts as
//! surface.

use super::winding_number::{SURFACE_LEVEL, WindingNumber, point_areas};
use crate::geometry::{Aabb, Cloud, Vec3};
use rayon::prelude::*;

/// The cloud with points of the support plane z = 0 added at the distance `spacing` (metres)
/// wherever the object stands on it: outward normal -z, unknown standard deviation, support by 0
/// scans.
///
/// Together with its mirror image below the plane the object is a closed body, whose winding number
/// tells which part of the plane lies inside, however ragged the lower border of the measured
/// points is.
pub(super) fn with_support_plane(cloud: &Cloud, spacing: f64) -> Cloud {
    let doubled = with_mirror_image(cloud);
    let winding = WindingNumber::new(&doubled, &point_areas(&doubled, spacing), spacing);
    let bounds = Aabb::from_points(&cloud.points);
    let steps = [0, 1].map(|i| (bounds.extent()[i] / spacing).ceil() as usize);
    let corner = Vec3::new(bounds.min.x, bounds.min.y, 0.0);
    let grid: Vec<Vec3> = (0..(steps[0] + 1) * (steps[1] + 1))
        .map(|index| (index % (steps[0] + 1), index / (steps[0] + 1)))
        .map(|(x, y)| corner + Vec3::new(x as f64, y as f64, 0.0) * spacing)
        .collect();
    let inside: Vec<bool> =
        grid.par_iter().map(|point| winding.at(point) > SURFACE_LEVEL).collect();
    let mut supported = cloud.clone();
    for (point, _) in grid.iter().zip(&inside).filter(|(_, inside)| **inside) {
        supported.push(*point, -Vec3::z(), f64::NAN, 0);
    }
    supported
}

/// The cloud and its mirror image below the plane z = 0.
fn with_mirror_image(cloud: &Cloud) -> Cloud {
    let mut doubled = cloud.clone();
    for i in 0..cloud.len() {
        doubled.push(
            mirrored(&cloud.points[i]),
            mirrored(&cloud.normals[i]),
            cloud.sigma[i],
            cloud.support[i],
        );
    }
    doubled
}

fn mirrored(v: &Vec3) -> Vec3 {
    Vec3::new(v.x, v.y, -v.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_plane_is_added_where_a_box_stands_on_it() {
        // Sides and top of a box of 20 x 20 x 10 mm, at 1 mm.
        let mut cloud = Cloud::default();
        for i in 0..20 {
            for j in 0..20 {
                let (u, v) = (f64::from(i) - 9.5, f64::from(j) - 9.5);
                cloud.push(Vec3::new(u, v, 10.0) * 1e-3, Vec3::z(), 1e-5, 2);
                if j < 10 {
                    for normal in [Vec3::x(), -Vec3::x()] {
                        let side = Vec3::new(0.0, u, f64::from(j) + 0.5) * 1e-3;
                        cloud.push(side + normal * 0.01, normal, 1e-5, 2);
                        let side = Vec3::new(u, 0.0, f64::from(j) + 0.5) * 1e-3;
                        let normal = Vec3::new(0.0, normal.x, 0.0);
                        cloud.push(side + normal * 0.01, normal, 1e-5, 2);
                    }
                }
            }
        }
        let supported = with_support_plane(&cloud, 1e-3);
        let added = cloud.len()..supported.len();
        assert!((350..=450).contains(&added.len()), "{}", added.len());
        for i in added {
            assert!(supported.points[i].z == 0.0 && supported.points[i].amax() < 0.0105);
            assert_eq!((supported.normals[i], supported.support[i]), (-Vec3::z(), 0));
            assert!(supported.sigma[i].is_nan());
        }
    }
}
