//! The update of the space by a scan: evidence, states, and what follows from them.

use super::carving::{ScanEvidence, carve, carve_beyond};
use super::simulated_scan::{RayPattern, simulate_scan};
use super::space::{ViewSpace, ball_offsets};
use super::voxel_state::{VoxelRecord, VoxelState};
use crate::geometry::{Pose, Scan};
use crate::voxel::{SlotSet, Voxel};
use crate::{Error, Result};

/// Rays of the simulated scan that finds what was visible are this many times as dense as voxels,
/// so that hardly a voxel lies between them.
const RAYS_PER_VOXEL: f64 = 2.0;

impl ViewSpace {
    /// Integrates a scan (sensor frame, metres) from `object_from_sensor`.
    ///
    /// # Errors
    /// [`Error::Input`] if the pose is not finite or the scan's vectors differ in length.
    pub fn integrate(&mut self, scan: &Scan, object_from_sensor: &Pose) -> Result<()> {
        self.integrate_with_beyond(scan, &Scan::default(), object_from_sensor)
    }

    /// As [`ViewSpace::integrate`], with returns of the same scan that lie `beyond` the object, on
    /// robot, table or background: they say only that the space before them is free.
    ///
    /// # Errors
    /// As [`ViewSpace::integrate`].
    pub fn integrate_with_beyond(
        &mut self,
        scan: &Scan,
        beyond: &Scan,
        object_from_sensor: &Pose,
    ) -> Result<()> {
        check_scan(scan, object_from_sensor)?;
        check_scan(beyond, object_from_sensor)?;
        let mut evidence = carve(&self.grid, scan, object_from_sensor, self.params.min_support);
        carve_beyond(&self.grid, beyond, object_from_sensor, &mut evidence);
        self.add_evidence(&evidence);
        self.update_states();
        self.scanned.push(*object_from_sensor);
        self.count_tries(&evidence, object_from_sensor);
        Ok(())
    }

    fn add_evidence(&mut self, evidence: &ScanEvidence) {
        for hits in &evidence.hits {
            let voxel = self.grid.get_mut(hits.slot);
            if voxel.state != VoxelState::Excluded {
                voxel.points = voxel.points.saturating_add(hits.points);
                voxel.hits = voxel.hits.saturating_add(1);
            }
        }
        for slot in evidence.traversed.iter() {
            let voxel = self.grid.get_mut(slot);
            voxel.traversed = true;
            if evidence.passed.contains(slot) && !evidence.hit.contains(slot) {
                voxel.passes = voxel.passes.saturating_add(1);
            }
        }
        for slot in evidence.occluded.iter() {
            self.grid.get_mut(slot).occluded = true;
        }
    }

    /// Sets all states from the evidence.
    fn update_states(&mut self) {
        let slots: Vec<u32> = self.grid.iter().map(|(slot, _)| slot).collect();
        let hit_weight = self.params.hit_weight;
        let mut inside = Vec::new();
        for slot in slots {
            let voxel = self.grid.get_mut(slot);
            let state = state_from_evidence(voxel, hit_weight);
            if state == VoxelState::PossibleInside {
                inside.push(slot);
            }
            if state != voxel.state {
                voxel.tries = if state == VoxelState::PossibleInside { voxel.tries } else { 0 };
                voxel.state = state;
            }
        }
        self.update_borders(&inside);
        self.mark_near_surface();
        self.describe_surface();
    }

    /// Makes the unknown neighbours of the possible inside voxels `inside` the possible border.
    fn update_borders(&mut self, inside: &[u32]) {
        let mut borders = SlotSet::new(self.grid.slots());
        for &slot in inside {
            for next in self.grid.neighbours(slot) {
                let state = self.grid.get(next).state;
                if matches!(state, VoxelState::Unknown | VoxelState::PossibleBorder) {
                    borders.insert(next);
                }
            }
        }
        for slot in self.slots_where(|voxel| voxel.state == VoxelState::PossibleBorder) {
            if !borders.contains(slot) {
                self.grid.get_mut(slot).state = VoxelState::Unknown;
            }
        }
        for slot in borders.iter() {
            self.grid.get_mut(slot).state = VoxelState::PossibleBorder;
        }
    }

    /// Marks the hidden voxels within reach of a surface voxel. Hidden space extends to the end of
    /// the region, the object does not: surface that was not seen yet adjoins surface that was.
    fn mark_near_surface(&mut self) {
        let ball: Vec<Voxel> = ball_offsets(self.params.hidden_reach as i32).collect();
        let mut near = SlotSet::new(self.grid.slots());
        for (slot, _) in self.grid.iter().filter(|(_, v)| v.state == VoxelState::Occupied) {
            let [x, y, z] = self.grid.voxel(slot);
            for [dx, dy, dz] in &ball {
                if let Some(slot) = self.grid.slot([x + dx, y + dy, z + dz]) {
                    near.insert(slot);
                }
            }
        }
        for slot in self.slots_where(VoxelRecord::is_hidden) {
            self.grid.get_mut(slot).near_surface = near.contains(slot);
        }
    }

    /// Stores for each surface voxel its outward direction, and whether it or a voxel that touches
    /// it has its points. A surface that cuts a corner off a voxel, or noise, leaves a few points
    /// beside voxels that show the same surface.
    fn describe_surface(&mut self) {
        let mut beside = SlotSet::new(self.grid.slots());
        for (slot, _) in self.grid.iter().filter(|(_, voxel)| self.is_satisfied(voxel)) {
            for near in self.grid.cube_around(slot) {
                beside.insert(near);
            }
        }
        for slot in self.slots_where(|voxel| voxel.state == VoxelState::Occupied) {
            let outward = self.outward_direction(slot);
            let voxel = self.grid.get_mut(slot);
            voxel.set_outward(outward);
            voxel.beside_satisfied = beside.contains(slot);
        }
    }

    /// Counts a try for each voxel that was visible to the scan, still needs measurements, and got
    /// none; stores the quality of the others. Only what a candidate's simulated scan would count
    /// gets a try, so that no view can promise the same gain for ever.
    fn count_tries(&mut self, evidence: &ScanEvidence, pose: &Pose) {
        let pattern = RayPattern::new(&self.sensor, self.edge() / RAYS_PER_VOXEL);
        let mut seen = SlotSet::new(self.grid.slots());
        let (mut in_vain, mut measured) = (Vec::new(), Vec::new());
        simulate_scan(self, &pattern, pose, &mut seen, |seen| {
            if seen.voxel.state == VoxelState::Occupied && evidence.hit.contains(seen.slot) {
                measured.push((seen.slot, seen.along));
            } else if self.lacks_points(seen.voxel) || self.may_hide_surface(seen.voxel) {
                in_vain.push(seen.slot);
            }
        });
        for slot in in_vain {
            let voxel = self.grid.get_mut(slot);
            voxel.tries = voxel.tries.saturating_add(1);
        }
        for (slot, along) in measured {
            let Some(normal) = self.outward_direction(slot) else { continue };
            self.grid.get_mut(slot).raise_quality(&along, &normal);
        }
    }

    /// The slots of the voxels for which `condition` holds, ascending.
    fn slots_where(&self, condition: impl Fn(&VoxelRecord) -> bool) -> Vec<u32> {
        let matching = self.grid.iter().filter(|(_, voxel)| condition(voxel));
        matching.map(|(slot, _)| slot).collect()
    }
}

/// The state that follows from a voxel's evidence: occupied before free before possible inside.
fn state_from_evidence(voxel: &VoxelRecord, hit_weight: f64) -> VoxelState {
    let is_surface =
        voxel.hits > 0 && f64::from(voxel.passes) <= hit_weight * f64::from(voxel.hits);
    match voxel.state {
        VoxelState::Excluded => VoxelState::Excluded,
        _ if is_surface => VoxelState::Occupied,
        _ if voxel.traversed => VoxelState::Free,
        _ if voxel.occluded => VoxelState::PossibleInside,
        // Unknown or border; which of them is decided by `update_borders`.
        old => old,
    }
}

fn check_scan(scan: &Scan, pose: &Pose) -> Result<()> {
    if !pose.to_homogeneous().iter().all(|v| v.is_finite()) {
        return Err(Error::input(
            "the scan's pose holds numbers that are not finite: leave it out",
        ));
    }
    if !scan.origins.is_empty() && scan.origins.len() != scan.points.len() {
        return Err(Error::input(format!(
            "the scan has {} points but {} ray origins; it needs one a point or none at all",
            scan.points.len(),
            scan.origins.len()
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::ViewParams;
    use crate::view::tests::{above, plate, space_with_plate};

    #[test]
    fn evidence_decides_in_the_order_occupied_free_possible_inside() {
        let nothing = VoxelRecord::default();
        let hidden = VoxelRecord { occluded: true, ..nothing };
        let seen_through = VoxelRecord { traversed: true, passes: 5, ..hidden };
        let hit = VoxelRecord { hits: 3, passes: 6, ..seen_through };
        let outvoted = VoxelRecord { passes: 7, ..hit };
        assert_eq!(state_from_evidence(&nothing, 2.0), VoxelState::Unknown);
        assert_eq!(state_from_evidence(&hidden, 2.0), VoxelState::PossibleInside);
        assert_eq!(state_from_evidence(&seen_through, 2.0), VoxelState::Free);
        assert_eq!(state_from_evidence(&hit, 2.0), VoxelState::Occupied);
        assert_eq!(state_from_evidence(&outvoted, 2.0), VoxelState::Free);
        let border = VoxelRecord { state: VoxelState::PossibleBorder, ..nothing };
        assert_eq!(state_from_evidence(&border, 2.0), VoxelState::PossibleBorder);
        let solid = VoxelRecord { state: VoxelState::Excluded, ..hit };
        assert_eq!(state_from_evidence(&solid, 2.0), VoxelState::Excluded);
    }

    #[test]
    fn borders_and_nearness_are_those_that_brute_force_finds() {
        let mut space = space_with_plate(&ViewParams::default());
        space.integrate(&plate(0.02, 0.012), &above()).unwrap();
        let reach = space.params.hidden_reach as i32;
        let surface: Vec<Voxel> = space
            .slots_where(|voxel| voxel.state == VoxelState::Occupied)
            .into_iter()
            .map(|slot| space.grid.voxel(slot))
            .collect();
        let mut borders = 0;
        for slot in 0..space.grid.slots() as u32 {
            let [x, y, z] = space.grid.voxel(slot);
            if space.grid.slot([x, y, z]).is_none() {
                continue;
            }
            let voxel = space.grid.get(slot);
            if matches!(voxel.state, VoxelState::Unknown | VoxelState::PossibleBorder) {
                let beside_inside = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].iter().any(|[i, j, k]| {
                    [1, -1].iter().any(|s| {
                        let near = space.grid.slot([x + s * i, y + s * j, z + s * k]);
                        near.is_some_and(|near| {
                            space.grid.get(near).state == VoxelState::PossibleInside
                        })
                    })
                });
                assert_eq!(voxel.state == VoxelState::PossibleBorder, beside_inside);
                borders += usize::from(beside_inside);
            }
            if voxel.is_hidden() {
                let near = surface.iter().any(|[i, j, k]| {
                    (i - x).pow(2) + (j - y).pow(2) + (k - z).pow(2) <= reach * reach
                });
                assert_eq!(voxel.near_surface, near);
            }
        }
        assert!(borders > 500, "{borders}");
    }
}
