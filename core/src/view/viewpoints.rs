//! Candidate viewpoints (Wiedemann 2014, §2.2.1).

use super::space::ViewSpace;
use super::voxel_state::VoxelState;
use crate::geometry::{Pose, Vec3};
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};
use rayon::prelude::*;

/// Shorter vectors have no direction: their components cancel out but for rounding.
const MIN_DIRECTION_NORM: f64 = 1e-9;

/// A viewpoint and its viewing direction, object frame.
#[derive(Clone, Copy, Debug)]
struct Viewpoint {
    position: Vec3,
    direction: Vec3,
}

/// Viewpoints that are similar to the first of them.
struct Cluster {
    first: Viewpoint,
    /// Sums of positions and directions.
    sum: Viewpoint,
    count: f64,
}

/// The candidate views of a space, `object_from_sensor`: one for each voxel that needs
/// measurements, merged where they are similar, without those already used.
pub(crate) fn candidate_views(space: &ViewSpace) -> Vec<Pose> {
    let viewpoints = viewpoints_of_voxels(space);
    let radius = space.params.merge_distance * space.params.distance(&space.sensor);
    let merged = merge_viewpoints(&viewpoints, radius, space.params.merge_angle);
    let poses = merged.iter().map(|v| looking_along(&v.position, &v.direction));
    poses.filter(|pose| !is_used(space, pose)).collect()
}

/// Whether `pose` (`object_from_sensor`) is similar to a view already used.
pub(crate) fn is_used(space: &ViewSpace, pose: &Pose) -> bool {
    let max_distance = space.params.used_distance * space.params.distance(&space.sensor);
    let max_angle = space.params.used_angle;
    space.used_views().any(|used| {
        let distance = (used.translation.vector - pose.translation.vector).norm();
        let (a, b) = (used.rotation * Vec3::z(), pose.rotation * Vec3::z());
        distance <= max_distance && a.angle(&b) <= max_angle
    })
}

/// The pose `object_from_sensor` at `position` that looks along the unit vector `direction`, the
/// image upright (y towards the object's -z); straight up or down, the image's right is the
/// object's x.
pub(crate) fn looking_along(position: &Vec3, direction: &Vec3) -> Pose {
    let right = (-Vec3::z()).cross(direction);
    let x = right.try_normalize(MIN_DIRECTION_NORM).unwrap_or_else(Vec3::x);
    let rotation = Matrix3::from_columns(&[x, direction.cross(&x), *direction]);
    Pose::from_parts(
        Translation3::from(*position),
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation)),
    )
}

/// One viewpoint for each voxel that needs measurements and has an outward direction.
fn viewpoints_of_voxels(space: &ViewSpace) -> Vec<Viewpoint> {
    let distance = space.params.distance(&space.sensor);
    let needy = space.grid.iter().filter(|(_, voxel)| {
        space.lacks_points(voxel)
            || voxel.state == VoxelState::PossibleBorder && space.may_hide_surface(voxel)
    });
    let needy: Vec<u32> = needy.map(|(slot, _)| slot).collect();
    needy
        .into_par_iter()
        .filter_map(|slot| {
            let outward = space.outward_direction(slot)?;
            let position = space.grid.center(slot) + outward * distance; // p_i = b_i + d_c d_i
            Some(Viewpoint { position, direction: -outward }) // v_i = -d_i
        })
        .collect()
}

/// Merges viewpoints within `radius` (metres) and `angle` (radians) of the first of their cluster:
/// position and direction are averaged.
fn merge_viewpoints(viewpoints: &[Viewpoint], radius: f64, angle: f64) -> Vec<Viewpoint> {
    let mut clusters: Vec<Cluster> = Vec::new();
    for viewpoint in viewpoints {
        let similar =
            clusters.iter_mut().find(|cluster| cluster.first.is_similar(viewpoint, radius, angle));
        match similar {
            Some(cluster) => {
                cluster.sum.position += viewpoint.position;
                cluster.sum.direction += viewpoint.direction;
                cluster.count += 1.0;
            }
            None => clusters.push(Cluster { first: *viewpoint, sum: *viewpoint, count: 1.0 }),
        }
    }
    clusters.iter().map(Cluster::mean).collect()
}

impl Viewpoint {
    fn is_similar(&self, other: &Viewpoint, radius: f64, angle: f64) -> bool {
        (self.position - other.position).norm() <= radius
            && self.direction.dot(&other.direction) >= angle.cos()
    }
}

impl Cluster {
    fn mean(&self) -> Viewpoint {
        let direction = self.sum.direction.try_normalize(MIN_DIRECTION_NORM);
        Viewpoint {
            position: self.sum.position / self.count,
            direction: direction.unwrap_or(self.first.direction),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::ViewParams;
    use crate::view::tests::{above, space_with_plate};

    fn viewpoint(position: [f64; 3], direction: [f64; 3]) -> Viewpoint {
        Viewpoint { position: Vec3::from(position), direction: Vec3::from(direction).normalize() }
    }

    #[test]
    fn viewpoints_are_merged_with_the_first_that_is_near_and_looks_the_same_way() {
        let down = [0.0, 0.0, -1.0];
        let viewpoints = [
            viewpoint([0.0, 0.0, 0.0], down),
            viewpoint([0.3, 0.0, 0.0], [0.2, 0.0, -1.0]),
            // Near the second, too far from the first.
            viewpoint([0.6, 0.0, 0.0], down),
            // Near, but looks elsewhere.
            viewpoint([0.1, 0.0, 0.0], [1.0, 0.0, 0.0]),
        ];
        let merged = merge_viewpoints(&viewpoints, 0.4, 0.25);
        assert_eq!(merged.len(), 3);
        assert!((merged[0].position - Vec3::x() * 0.15).norm() < 1e-12);
        // Halfway between two directions 0.1974 rad apart.
        let tilt = merged[0].direction.angle(&-Vec3::z());
        assert!((tilt - 0.2_f64.atan() / 2.0).abs() < 1e-12, "{tilt}");
        assert_eq!((merged[1].position.x, merged[2].position.x), (0.6, 0.1));
        assert_eq!(merge_viewpoints(&viewpoints, 0.4, 0.15).len(), 4);
    }

    #[test]
    fn opposite_directions_keep_the_first() {
        let viewpoints = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]].map(|d| viewpoint([0.0; 3], d));
        let merged = merge_viewpoints(&viewpoints, 1.0, std::f64::consts::PI);
        assert_eq!((merged.len(), merged[0].direction), (1, Vec3::z()));
    }

    #[test]
    fn an_image_is_upright_and_straight_down_its_right_is_x() {
        for direction in [[1.0, 0.2, -0.3], [0.0, -1.0, 0.9], [-0.4, 0.1, 0.0]].map(Vec3::from) {
            let direction = direction.normalize();
            let pose = looking_along(&Vec3::new(1.0, 2.0, 3.0), &direction);
            assert!((pose.rotation * Vec3::z() - direction).norm() < 1e-12);
            assert!((pose.rotation * Vec3::x()).z.abs() < 1e-12);
            assert!((pose.rotation * Vec3::y()).z < 0.0);
            assert_eq!(pose.translation.vector, Vec3::new(1.0, 2.0, 3.0));
        }
        let down = looking_along(&Vec3::zeros(), &-Vec3::z());
        assert!((down.rotation * Vec3::x() - Vec3::x()).norm() < 1e-12);
    }

    #[test]
    fn candidates_stand_at_the_working_distance_from_what_they_look_at() {
        let params = ViewParams { merge_distance: 0.0, merge_angle: 0.0, ..ViewParams::default() };
        let mut space = space_with_plate(&params);
        let views = candidate_views(&space);
        assert!(views.len() > 100, "{}", views.len());
        let distance = params.distance(&space.sensor);
        for view in &views {
            let target = view * nalgebra::Point3::new(0.0, 0.0, distance);
            let slot = space.grid.slot_at(&target.coords).unwrap();
            assert!((space.grid.center(slot) - target.coords).norm() < 1e-9);
            let voxel = space.grid.get(slot);
            assert!(space.lacks_points(voxel) || space.may_hide_surface(voxel));
            let outward = space.outward_direction(slot).unwrap();
            assert!((view.rotation * Vec3::z() + outward).norm() < 1e-9);
            assert!(!is_used(&space, view));
        }
        let merged = ViewParams::default();
        (space.params.merge_distance, space.params.merge_angle) =
            (merged.merge_distance, merged.merge_angle);
        let fewer = candidate_views(&space).len();
        assert!((1..views.len() / 2).contains(&fewer), "{fewer} of {}", views.len());
    }

    #[test]
    fn a_view_is_used_if_both_its_position_and_its_direction_are_near() {
        let space = space_with_plate(&ViewParams::default());
        let distance = space.params.used_distance * space.params.distance(&space.sensor);
        for (share, expected) in [(0.99, true), (1.01, false)] {
            let moved = Pose::translation(share * distance, 0.0, 0.0) * above();
            assert_eq!(is_used(&space, &moved), expected);
            let turned = above() * Pose::rotation(Vec3::x() * (share * space.params.used_angle));
            assert_eq!(is_used(&space, &turned), expected);
        }
    }
}
