//! Candidates for the next view (Wiedemann 2014, §2.2.1).

use super::cell::State;
use super::looking_along;
use super::space::ViewSpace;
use crate::geometry::{Pose, Vec3};
use rayon::prelude::*;

/// A sum of directions shorter than this share of their number has no side that one could call outward.
const DECIDED: f64 = 0.1;

/// A viewpoint and its viewing direction, object frame.
#[derive(Clone, Copy, Debug)]
struct Viewpoint {
    position: Vec3,
    direction: Vec3,
}

/// Candidates of the space: made, held against used views, merged.
pub(crate) fn candidates(space: &ViewSpace) -> Vec<Pose> {
    let made: Vec<Viewpoint> = made(space);
    let distance = space.params.distance(&space.sensor);
    let merged = merge(&made, space.params.merge_distance * distance, space.params.merge_angle);
    let poses = merged.iter().map(|v| looking_along(&v.position, &v.direction));
    poses.filter(|pose| !is_used(space, pose)).collect()
}

/// Whether `pose` is similar to a view already used.
pub(crate) fn is_used(space: &ViewSpace, pose: &Pose) -> bool {
    let distance = space.params.used_distance * space.params.distance(&space.sensor);
    let angle = space.params.used_angle;
    space.used().any(|used| {
        let apart = (used.translation.vector - pose.translation.vector).norm();
        let (a, b) = (used.rotation * Vec3::z(), pose.rotation * Vec3::z());
        apart <= distance && a.angle(&b) <= angle
    })
}

/// One viewpoint for each voxel that asks to be seen.
fn made(space: &ViewSpace) -> Vec<Viewpoint> {
    let distance = space.params.distance(&space.sensor);
    let asks = space.grid.iter().filter(|(_, cell)| {
        space.lacks_points(cell) || cell.state == State::PossibleBorder && space.hides(cell)
    });
    let asks: Vec<u32> = asks.map(|(slot, _)| slot).collect();
    asks.into_par_iter()
        .filter_map(|slot| {
            let outward = outward(space, slot)?;
            let position = space.grid.center(slot) + outward * distance; // p_i = b_i + d_c d_i
            Some(Viewpoint { position, direction: -outward }) // v_i = -d_i
        })
        .collect()
}

/// The direction from the possible inside voxels round `slot` to it, a unit vector: outward. `None` if there are
/// none, or they lie on all sides.
pub(crate) fn outward(space: &ViewSpace, slot: u32) -> Option<Vec3> {
    let reach = space.params.neighbourhood as i32;
    let [x, y, z] = space.grid.voxel(slot);
    let (mut sum, mut lengths) = (Vec3::zeros(), 0.0);
    for dz in -reach..=reach {
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                if dx * dx + dy * dy + dz * dz > reach * reach {
                    continue;
                }
                let Some(near) = space.grid.slot([x + dx, y + dy, z + dz]) else { continue };
                if space.grid.get(near).state == State::PossibleInside {
                    let from = -Vec3::new(dx.into(), dy.into(), dz.into()); // d_ji = b_i - l_j
                    (sum, lengths) = (sum + from, lengths + from.norm());
                }
            }
        }
    }
    (sum.norm() > DECIDED * lengths).then(|| sum.normalize()) // d_i
}

/// Merges viewpoints within `radius` (metres) and `angle` (radians) of the first of their kind: position and
/// direction are averaged.
fn merge(made: &[Viewpoint], radius: f64, angle: f64) -> Vec<Viewpoint> {
    let similar = |a: &Viewpoint, b: &Viewpoint| {
        (a.position - b.position).norm() <= radius && a.direction.dot(&b.direction) >= angle.cos()
    };
    let mut groups: Vec<(Viewpoint, Viewpoint, f64)> = Vec::new();
    for viewpoint in made {
        match groups.iter_mut().find(|(first, ..)| similar(first, viewpoint)) {
            Some((_, sum, count)) => {
                sum.position += viewpoint.position;
                sum.direction += viewpoint.direction;
                *count += 1.0;
            }
            None => groups.push((*viewpoint, *viewpoint, 1.0)),
        }
    }
    let average = |(first, sum, count): (Viewpoint, Viewpoint, f64)| Viewpoint {
        position: sum.position / count,
        direction: sum.direction.try_normalize(1e-9).unwrap_or(first.direction),
    };
    groups.into_iter().map(average).collect()
}
