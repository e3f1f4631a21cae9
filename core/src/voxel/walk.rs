//! The voxels along a ray (Amanatides & Woo 1987, A Fast Voxel Traversal Algorithm for Ray Tracing).

use super::{Voxel, voxel_of};
use crate::geometry::Vec3;

/// Voxels of edge `edge` along the ray from `origin` in the unit vector `direction`, in order, each with the
/// distance at which the ray enters it (0 for the first); ends at `reach` (metres).
pub fn walk(
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
        let steps: Vec<(Voxel, f64)> = walk(&origin, &direction, 0.1, 2.0).collect();
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
            walk(&Vec3::new(0.05, 0.05, 0.05), &Vec3::z(), 0.1, 1.0)
                .all(|(v, _)| v[0] == 0 && v[1] == 0)
        );
    }
}
