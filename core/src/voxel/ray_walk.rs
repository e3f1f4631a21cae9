//! The voxels along a ray (Amanatides & Woo 1987, A Fast Voxel Traversal Algorithm for Ray
//! Tracing).

use super::{Voxel, voxel_of};
use crate::geometry::Vec3;

/// The voxels of edge `edge` (metres) along the ray from `origin` in the unit vector `direction`,
/// in order, each with the distance (metres) at which the ray enters it, 0 for the first. It ends
/// at the distance `reach` (metres).
pub fn walk_ray(
    origin: &Vec3,
    direction: &Vec3,
    edge: f64,
    reach: f64,
) -> impl Iterator<Item = (Voxel, f64)> + use<> {
    let mut voxel = voxel_of(origin, edge);
    let step = [0, 1, 2].map(|i| direction[i].partial_cmp(&0.0).map_or(0, |o| o as i32));
    let delta = [0, 1, 2].map(|i| (edge / direction[i]).abs());
    let mut next = [0, 1, 2].map(|i| match step[i] {
        0 => f64::INFINITY,
        s => {
            let border = f64::from(voxel[i] + i32::from(s > 0)) * edge;
            (border - origin[i]) / direction[i]
        }
    });
    let mut entered = 0.0;
    std::iter::from_fn(move || {
        if entered > reach {
            return None;
        }
        let current = (voxel, entered);
        let axis = (0..3).fold(0, |best, i| if next[i] < next[best] { i } else { best });
        entered = next[axis];
        voxel[axis] += step[axis];
        next[axis] += delta[axis];
        Some(current)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_step_crosses_one_face_and_every_point_of_the_ray_is_covered() {
        let origin = Vec3::new(0.13, -0.27, 0.4);
        let direction = Vec3::new(-0.5, 0.7, 0.2).normalize();
        let steps: Vec<(Voxel, f64)> = walk_ray(&origin, &direction, 0.1, 2.0).collect();
        for pair in steps.windows(2) {
            let moved: i32 = (0..3).map(|i| (pair[1].0[i] - pair[0].0[i]).abs()).sum();
            assert_eq!(moved, 1);
            let middle = origin + direction * ((pair[0].1 + pair[1].1) / 2.0);
            assert_eq!(voxel_of(&middle, 0.1), pair[0].0);
        }
        assert!(steps.len() > 20);
    }

    #[test]
    fn a_ray_along_an_axis_stays_in_its_row() {
        assert!(
            walk_ray(&Vec3::new(0.05, 0.05, 0.05), &Vec3::z(), 0.1, 1.0)
                .all(|(v, _)| v[0] == 0 && v[1] == 0)
        );
    }

    /// Distances at which a ray enters and leaves a voxel, by the slab method.
    fn crossing(voxel: Voxel, origin: &Vec3, direction: &Vec3, edge: f64) -> Option<[f64; 2]> {
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for i in 0..3 {
            let low = (f64::from(voxel[i]) * edge - origin[i]) / direction[i];
            let high = (f64::from(voxel[i] + 1) * edge - origin[i]) / direction[i];
            (enter, leave) = (enter.max(low.min(high)), leave.min(low.max(high)));
        }
        (leave > enter + 1e-9).then_some([enter, leave])
    }

    #[test]
    fn the_voxels_are_those_that_brute_force_finds() {
        for k in 0..40 {
            let t = f64::from(k);
            let origin = Vec3::new((t * 1.7).sin(), (t * 0.9).cos(), (t * 2.3).sin()) * 0.3;
            let direction = Vec3::new((t * 0.7).cos(), (t * 1.1).sin(), 0.3 + (t * 0.4).cos());
            let direction = direction.normalize();
            let mut expected: Vec<(Voxel, f64)> = Vec::new();
            for x in -14..14 {
                for y in -14..14 {
                    for z in -14..14 {
                        let enter = crossing([x, y, z], &origin, &direction, 0.1);
                        let near = enter.filter(|[enter, _]| *enter <= 0.8);
                        expected.extend(near.map(|[enter, _]| ([x, y, z], enter)));
                    }
                }
            }
            expected.sort_by(|a, b| a.1.total_cmp(&b.1));
            let found: Vec<(Voxel, f64)> = walk_ray(&origin, &direction, 0.1, 0.8).collect();
            assert_eq!(found.len(), expected.len(), "ray {k}");
            for (found, expected) in found.iter().zip(&expected) {
                assert_eq!(found.0, expected.0, "ray {k}");
                assert!((found.1 - expected.1).abs() < 1e-9, "ray {k}");
            }
        }
    }
}
