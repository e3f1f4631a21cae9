//! The space that views are planned in.

use super::ViewParams;
use super::voxel_state::{VoxelCounts, VoxelRecord, VoxelState};
use crate::Result;
use crate::geometry::{Aabb, Pose, SensorModel, Vec3};
use crate::voxel::{BlockGrid, Voxel};

/// A sum of directions shorter than this share of the sum of their lengths has no side that could
/// be called outward.
const MIN_RESULTANT_RATIO: f64 = 0.1;
/// In [`ViewSpace::surface_center`], one in this many surface voxels is left out at each end of an
/// axis, as likely noise.
const TRIMMED_VOXELS: usize = 50;

/// The voxel space of the view planner (Wiedemann 2014, §2.1 and §2.2.1).
pub struct ViewSpace {
    pub(crate) grid: BlockGrid<VoxelRecord>,
    pub(crate) params: ViewParams,
    pub(crate) sensor: SensorModel,
    roi: Aabb,
    /// Views from which a scan was integrated, `object_from_sensor`.
    pub(super) scanned: Vec<Pose>,
    /// Views that are marked as used, `object_from_sensor`.
    marked: Vec<Pose>,
}

impl ViewSpace {
    /// A space of unknown voxels.
    ///
    /// * `sensor` - the sensor whose scans are integrated and planned
    /// * `roi` - the region of interest in the object frame, metres; nothing outside is planned for
    ///
    /// # Errors
    /// [`crate::Error::Input`] if the region is empty or holds too many voxels.
    pub fn new(sensor: SensorModel, roi: Aabb, params: &ViewParams) -> Result<ViewSpace> {
        let grid = BlockGrid::new(&roi, params.edge(&sensor))?;
        let (scanned, marked) = (Vec::new(), Vec::new());
        Ok(ViewSpace { grid, params: params.clone(), sensor, roi, scanned, marked })
    }

    /// Marks voxels whose centres lie in one of `boxes` (object frame, metres) as known to be
    /// solid. They stop rays, need no measurements and give no directions; points in them are
    /// ignored.
    pub fn exclude(&mut self, boxes: &[Aabb]) {
        self.exclude_where(|center| boxes.iter().any(|b| b.contains(center)));
    }

    /// Marks everything below the plane z = `height` (object frame, metres) as known to be solid:
    /// the object stands on it.
    pub fn exclude_below(&mut self, height: f64) {
        self.exclude_where(|center| center.z < height);
    }

    /// Marks the voxels for whose centres `is_solid` is true as solid, as [`ViewSpace::exclude`]
    /// does.
    pub fn exclude_where(&mut self, is_solid: impl Fn(&Vec3) -> bool) {
        for slot in 0..self.grid.slots() as u32 {
            if self.grid.slot(self.grid.voxel(slot)).is_some() && is_solid(&self.grid.center(slot))
            {
                *self.grid.get_mut(slot) =
                    VoxelRecord { state: VoxelState::Excluded, ..VoxelRecord::default() };
            }
        }
    }

    /// Marks a view as used although no scan of it was integrated (it failed, or could not be
    /// registered).
    pub fn mark_used(&mut self, object_from_sensor: &Pose) {
        self.marked.push(*object_from_sensor);
    }

    /// Forgets the views marked by [`ViewSpace::mark_used`].
    pub fn forget_marks(&mut self) {
        self.marked.clear();
    }

    /// Number of integrated scans.
    pub fn scan_count(&self) -> usize {
        self.scanned.len()
    }

    /// Edge of a voxel, metres.
    pub fn edge(&self) -> f64 {
        self.grid.edge()
    }

    /// The region of interest, object frame, metres.
    pub fn roi(&self) -> &Aabb {
        &self.roi
    }

    /// Bytes that the voxels take.
    pub fn memory(&self) -> usize {
        self.grid.memory()
    }

    /// State of the voxel at `point` (object frame, metres); `None` outside the region of interest.
    pub fn state_at(&self, point: &Vec3) -> Option<VoxelState> {
        Some(self.grid.get(self.grid.slot_at(point)?).state)
    }

    /// Centres (object frame, metres) and states of all voxels that are neither unknown nor free,
    /// in a fixed order, and for each whether it is satisfied (occupied with its minimum of
    /// points).
    pub fn voxels(&self) -> Vec<(Vec3, VoxelState, bool)> {
        let listed = self
            .grid
            .iter()
            .filter(|(_, voxel)| !matches!(voxel.state, VoxelState::Unknown | VoxelState::Free));
        listed
            .map(|(slot, voxel)| (self.grid.center(slot), voxel.state, self.is_satisfied(voxel)))
            .collect()
    }

    /// Numbers of voxels by what is known of them.
    pub fn counts(&self) -> VoxelCounts {
        let mut counts = VoxelCounts::default();
        for (slot, voxel) in self.grid.iter() {
            let given_up = self.is_given_up(voxel);
            match voxel.state {
                VoxelState::Unknown => {}
                VoxelState::Free => counts.free += 1,
                VoxelState::Occupied => {
                    let satisfied = self.is_satisfied(voxel);
                    counts.occupied += 1;
                    counts.satisfied += usize::from(satisfied);
                    counts.covered += usize::from(voxel.beside_satisfied);
                    counts.unmeasurable += usize::from(given_up && !satisfied);
                }
                VoxelState::PossibleInside => counts.possible_inside += 1,
                VoxelState::PossibleBorder => counts.possible_border += 1,
                VoxelState::Excluded => counts.excluded += 1,
            }
            counts.unresolved += usize::from(voxel.is_hidden() && given_up);
            counts.frontier += usize::from(self.may_hide_surface(voxel) && self.adjoins_free(slot));
        }
        let hidden = counts.possible_inside + counts.possible_border;
        let known = counts.free + counts.occupied + hidden + counts.excluded;
        counts.unknown = self.grid.voxels() - known;
        counts
    }

    fn adjoins_free(&self, slot: u32) -> bool {
        self.grid.neighbours(slot).any(|near| self.grid.get(near).state == VoxelState::Free)
    }

    /// Poses of all views that are not to be repeated.
    pub(crate) fn used_views(&self) -> impl Iterator<Item = &Pose> {
        self.scanned.iter().chain(&self.marked)
    }

    /// Whether a voxel is a surface voxel with its minimum of points.
    pub(super) fn is_satisfied(&self, voxel: &VoxelRecord) -> bool {
        voxel.state == VoxelState::Occupied && voxel.points as usize >= self.params.min_points
    }

    /// Whether too many scans from which a voxel was visible gave it no measurements.
    fn is_given_up(&self, voxel: &VoxelRecord) -> bool {
        usize::from(voxel.tries) >= self.params.max_tries
    }

    /// Whether a voxel is one of N: a surface that lacks points and is not given up.
    pub(crate) fn lacks_points(&self, voxel: &VoxelRecord) -> bool {
        voxel.state == VoxelState::Occupied && !self.is_satisfied(voxel) && !self.is_given_up(voxel)
    }

    /// Whether a voxel is one of M: hidden so far, where surface may be, and not given up.
    pub(crate) fn may_hide_surface(&self, voxel: &VoxelRecord) -> bool {
        voxel.is_hidden()
            && (voxel.near_surface || self.params.hidden_reach == 0)
            && !self.is_given_up(voxel)
    }

    /// The outward direction at a voxel, a unit vector: from the possible inside voxels around it
    /// to it. `None` if there are none, or if they lie on all sides.
    pub(crate) fn outward_direction(&self, slot: u32) -> Option<Vec3> {
        let reach = self.params.neighbourhood as i32;
        let [x, y, z] = self.grid.voxel(slot);
        let (mut sum, mut lengths) = (Vec3::zeros(), 0.0);
        for [dx, dy, dz] in ball_offsets(reach) {
            let Some(near) = self.grid.slot([x + dx, y + dy, z + dz]) else { continue };
            if self.grid.get(near).state == VoxelState::PossibleInside {
                let from = -Vec3::new(dx.into(), dy.into(), dz.into()); // d_ji = b_i - l_j
                (sum, lengths) = (sum + from, lengths + from.norm());
            }
        }
        (sum.norm() > MIN_RESULTANT_RATIO * lengths).then(|| sum.normalize()) // d_i
    }

    /// Centre of the surface measured so far, object frame, metres: in each axis halfway between
    /// the outermost voxels without likely noise. The centre of the region of interest if there is
    /// none.
    pub(crate) fn surface_center(&self) -> Vec3 {
        let occupied = self.grid.iter().filter(|(_, voxel)| voxel.state == VoxelState::Occupied);
        let centers: Vec<Vec3> = occupied.map(|(slot, _)| self.grid.center(slot)).collect();
        if centers.is_empty() {
            return self.roi.center();
        }
        Vec3::from_fn(|axis, _| {
            let mut along: Vec<f64> = centers.iter().map(|c| c[axis]).collect();
            along.sort_unstable_by(f64::total_cmp);
            let cut = along.len() / TRIMMED_VOXELS;
            (along[cut] + along[along.len() - 1 - cut]) / 2.0
        })
    }
}

/// The offsets of the voxels within `radius` voxels of one, in a fixed order: x varies fastest.
pub(super) fn ball_offsets(radius: i32) -> impl Iterator<Item = Voxel> {
    let range = -radius..=radius;
    let rows = range.clone().flat_map(move |z| range.clone().map(move |y| (y, z)));
    rows.flat_map(move |(y, z)| (-radius..=radius).map(move |x| [x, y, z]))
        .filter(move |[x, y, z]| x * x + y * y + z * z <= radius * radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::tests::{space_with_plate, unknown_space};

    #[test]
    fn a_ball_has_the_voxels_within_its_radius_once() {
        for (radius, count) in [(0, 1), (1, 7), (2, 33), (3, 123)] {
            let mut ball: Vec<Voxel> = ball_offsets(radius).collect();
            assert_eq!(ball.len(), count);
            assert!(ball.iter().all(|v| v.iter().map(|d| d * d).sum::<i32>() <= radius * radius));
            assert!(ball.is_sorted_by_key(|[x, y, z]| [*z, *y, *x]));
            ball.dedup();
            assert_eq!(ball.len(), count);
        }
    }

    #[test]
    fn outward_points_away_from_hidden_space_and_is_unknown_between_two_of_them() {
        let mut space = unknown_space(&ViewParams::default());
        let slot = space.grid.slot([0, 0, 0]).unwrap();
        assert_eq!(space.outward_direction(slot), None);
        let inside = [[-1, 0, 0], [-2, 0, 0], [0, -1, 0]];
        for voxel in inside {
            let near = space.grid.slot(voxel).unwrap();
            space.grid.get_mut(near).state = VoxelState::PossibleInside;
        }
        let expected = Vec3::new(3.0, 1.0, 0.0).normalize();
        assert!((space.outward_direction(slot).unwrap() - expected).norm() < 1e-12);
        // Beyond the neighbourhood nothing counts.
        let far = space.grid.slot([0, 0, 4]).unwrap();
        space.grid.get_mut(far).state = VoxelState::PossibleInside;
        assert!((space.outward_direction(slot).unwrap() - expected).norm() < 1e-12);
        for [x, y, z] in inside {
            let near = space.grid.slot([-x, -y, -z]).unwrap();
            space.grid.get_mut(near).state = VoxelState::PossibleInside;
        }
        assert_eq!(space.outward_direction(slot), None);
    }

    #[test]
    fn the_center_is_that_of_the_surface_or_of_the_region() {
        let empty = unknown_space(&ViewParams::default());
        assert!(empty.surface_center().norm() < 1e-12);
        let mut space = space_with_plate(&ViewParams::default());
        let center = space.surface_center();
        assert!((center - Vec3::new(0.0, 0.0, 0.0025)).norm() < 0.006, "{center:?}");
        // A single voxel far off is noise.
        let far = space.grid.slot_at(&Vec3::repeat(0.09)).unwrap();
        space.grid.get_mut(far).state = VoxelState::Occupied;
        assert_eq!(space.surface_center(), center);
    }
}
