//! Simulated scans through the voxel space (Wiedemann 2014, §2.2.1).

use super::cell::{Cell, State};
use super::params::ray_spacing;
use super::space::ViewSpace;
use crate::geometry::{Pose, SensorModel, SensorRay, Vec3};
use crate::voxel::SlotSet;
use nalgebra::Point3;

/// From the end of a ray to the witness, this many voxels are not looked at: they hold the same surface.
const SKIN: f64 = 2.0;

/// The rays of simulated scans.
pub(crate) struct Eye {
    rays: Vec<SensorRay>,
    range: [f64; 2],
}

impl Eye {
    /// Rays about `spacing` (metres) apart at the working distance.
    pub(crate) fn new(sensor: &SensorModel, spacing: f64) -> Eye {
        let step = (spacing / ray_spacing(sensor)).round().max(1.0) as usize;
        Eye { rays: sensor.rays(step), range: sensor.range() }
    }
}

/// How many rays of a simulated scan met what.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Met {
    /// Known surface that faces the sensor, with nothing hidden before it.
    pub surface: usize,
    /// Hidden voxels first.
    pub hidden: usize,
}

impl Met {
    /// Share of the rays into the object that meet known surface. Shadow that hides no surface is not the object.
    pub(crate) fn overlap(&self) -> f64 {
        self.surface as f64 / (self.surface + self.hidden).max(1) as f64
    }
}

/// Looks from `pose`; calls `visit(slot, cell, direction of the first ray)` once for each voxel penetrated that
/// is not free or solid. A ray ends in the first occupied voxel, else at the sensor's range.
pub(crate) fn look(
    space: &ViewSpace,
    eye: &Eye,
    pose: &Pose,
    seen: &mut SlotSet,
    mut visit: impl FnMut(u32, &Cell, &Vec3),
) -> Met {
    let mut met = Met::default();
    for ray in &eye.rays {
        let from = pose.transform_point(&Point3::from(ray.origin)).coords;
        let along = pose.rotation * ray.direction;
        let mut hidden = false;
        for step in space.grid.walk(&from, &along, eye.range[0], eye.range[1]) {
            let cell = space.grid.get(step.slot);
            match cell.state {
                State::Free => {}
                State::Excluded => break,
                State::Occupied => {
                    met.surface += usize::from(!hidden && cell.faces(&along));
                    let fresh = !seen.contains(step.slot);
                    if fresh
                        && (!space.lacks_points(cell) || witnessed(space, pose, ray, step.slot))
                    {
                        seen.insert(step.slot);
                        visit(step.slot, cell, &along);
                    }
                    break;
                }
                State::Unknown | State::PossibleInside | State::PossibleBorder => {
                    hidden |= space.hides(cell);
                    if seen.insert(step.slot) {
                        visit(step.slot, cell, &along);
                    }
                }
            }
        }
        met.hidden += usize::from(hidden);
    }
    met
}

/// Whether no known surface stands between the voxel and the sensor's second eye.
fn witnessed(space: &ViewSpace, pose: &Pose, ray: &SensorRay, slot: u32) -> bool {
    let eye = pose.transform_point(&Point3::from(ray.witness)).coords;
    let center = space.grid.center(slot);
    let distance = (center - eye).norm();
    let along = (center - eye) / distance;
    let solid = |state: State| matches!(state, State::Occupied | State::Excluded);
    let mut way = space.grid.walk(&eye, &along, 0.0, distance - SKIN * space.edge());
    !way.any(|step| solid(space.grid.get(step.slot).state))
}
