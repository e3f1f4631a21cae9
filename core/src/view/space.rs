//! The space that views are planned in.

use super::ViewParams;
use super::carve::{Carved, carve, see_past};
use super::cell::{Cell, Counts, State};
use super::look::{Eye, look};
use crate::geometry::{Aabb, Pose, Scan, SensorModel, Vec3};
use crate::voxel::{BlockGrid, SlotSet, Voxel};
use crate::{Error, Result};

/// The voxel space of the view planner (Wiedemann 2014, §2.1 and §2.2.1).
pub struct ViewSpace {
    pub(crate) grid: BlockGrid<Cell>,
    pub(crate) params: ViewParams,
    pub(crate) sensor: SensorModel,
    roi: Aabb,
    scans: usize,
    /// Views from which a scan was taken in, and those that were marked.
    used: Vec<Pose>,
    marked: Vec<Pose>,
}

impl ViewSpace {
    /// A space of unknown voxels.
    ///
    /// * `sensor` - whose scans come in and are planned
    /// * `roi` - the region of interest in the object frame, metres; nothing outside is planned for
    ///
    /// # Errors
    /// [`Error::Input`] if the region is empty or holds too many voxels.
    pub fn new(sensor: SensorModel, roi: Aabb, params: &ViewParams) -> Result<ViewSpace> {
        let grid = BlockGrid::new(&roi, params.edge(&sensor))?;
        let (used, marked) = (Vec::new(), Vec::new());
        Ok(ViewSpace { grid, params: params.clone(), sensor, roi, scans: 0, used, marked })
    }

    /// Marks voxels whose centres lie in one of `boxes` (object frame, metres) as known to be solid. They stop
    /// rays, ask for nothing and give no directions; points in them are ignored.
    pub fn exclude(&mut self, boxes: &[Aabb]) {
        self.exclude_where(|center| boxes.iter().any(|b| b.contains(center)));
    }

    /// Marks all below the plane z = `height` (object frame, metres) as known to be solid: the object stands on it.
    pub fn exclude_below(&mut self, height: f64) {
        self.exclude_where(|center| center.z < height);
    }

    /// Marks voxels whose centres `solid` says to be solid, as [`ViewSpace::exclude`] does.
    pub fn exclude_where(&mut self, solid: impl Fn(&Vec3) -> bool) {
        for slot in 0..self.grid.slots() as u32 {
            if self.grid.slot(self.grid.voxel(slot)).is_some() && solid(&self.grid.center(slot)) {
                *self.grid.get_mut(slot) = Cell { state: State::Excluded, ..Cell::default() };
            }
        }
    }

    /// Takes in a scan (sensor frame) from `object_from_sensor`.
    ///
    /// # Errors
    /// [`Error::Input`] if the pose is not finite or the scan's vectors differ in length.
    pub fn integrate(&mut self, scan: &Scan, object_from_sensor: &Pose) -> Result<()> {
        self.integrate_with(scan, &Scan::default(), object_from_sensor)
    }

    /// As [`ViewSpace::integrate`], with returns of the same scan that lie beyond the object, on robot, table or
    /// background: they say only that nothing stands before them.
    ///
    /// # Errors
    /// As [`ViewSpace::integrate`].
    pub fn integrate_with(
        &mut self,
        scan: &Scan,
        beyond: &Scan,
        object_from_sensor: &Pose,
    ) -> Result<()> {
        check(scan, object_from_sensor)?;
        check(beyond, object_from_sensor)?;
        let mut carved = carve(&self.grid, scan, object_from_sensor, self.params.min_support);
        see_past(&self.grid, beyond, object_from_sensor, &mut carved);
        self.apply(&carved);
        self.judge();
        self.scans += 1;
        self.used.push(*object_from_sensor);
        self.note_looks(&carved, object_from_sensor);
        Ok(())
    }

    /// Forgets all scans and takes in these, with their corrected poses. Solid space and marked views are kept.
    ///
    /// # Errors
    /// As [`ViewSpace::integrate`]; the space then holds the scans before the faulty one.
    pub fn rebuild(&mut self, scans: &[(&Scan, Pose)]) -> Result<()> {
        let mut grid = BlockGrid::new(&self.roi, self.grid.edge())?;
        for (slot, cell) in self.grid.iter() {
            if cell.state == State::Excluded {
                *grid.get_mut(slot) = *cell;
            }
        }
        (self.grid, self.scans) = (grid, 0);
        self.used.clear();
        scans.iter().try_for_each(|(scan, pose)| self.integrate(scan, pose))
    }

    /// Remembers a view as used although no scan of it was taken in (it failed, or could not be registered).
    pub fn mark_used(&mut self, object_from_sensor: &Pose) {
        self.marked.push(*object_from_sensor);
    }

    /// Forgets the views marked by [`ViewSpace::mark_used`].
    pub fn forget_marks(&mut self) {
        self.marked.clear();
    }

    /// Number of scans taken in.
    pub fn scans(&self) -> usize {
        self.scans
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
    pub fn state_at(&self, point: &Vec3) -> Option<State> {
        Some(self.grid.get(self.grid.slot_at(point)?).state)
    }

    /// Centres (object frame, metres) and states of all voxels that are neither unknown nor free, in a fixed
    /// order, and for each whether it is satisfied (occupied with its minimum of points).
    pub fn voxels(&self) -> Vec<(Vec3, State, bool)> {
        let told = |cell: &Cell| !matches!(cell.state, State::Unknown | State::Free);
        let told = self.grid.iter().filter(|(_, cell)| told(cell));
        told.map(|(slot, cell)| (self.grid.center(slot), cell.state, self.satisfied(cell)))
            .collect()
    }

    /// Numbers of voxels by what is known of them.
    pub fn counts(&self) -> Counts {
        let mut counts = Counts::default();
        for (slot, cell) in self.grid.iter() {
            let given_up = self.given_up(cell);
            match cell.state {
                State::Unknown => {}
                State::Free => counts.free += 1,
                State::Occupied => {
                    counts.occupied += 1;
                    counts.satisfied += usize::from(self.satisfied(cell));
                    counts.covered += usize::from(cell.beside);
                    counts.unmeasurable += usize::from(given_up && !self.satisfied(cell));
                }
                State::PossibleInside => counts.possible_inside += 1,
                State::PossibleBorder => counts.possible_border += 1,
                State::Excluded => counts.excluded += 1,
            }
            counts.unresolved += usize::from(cell.is_hidden() && given_up);
            counts.frontier += usize::from(self.hides(cell) && self.borders_on_free(slot));
        }
        let hidden = counts.possible_inside + counts.possible_border;
        let told = counts.free + counts.occupied + hidden + counts.excluded;
        counts.unknown = self.grid.voxels() - told;
        counts
    }

    fn borders_on_free(&self, slot: u32) -> bool {
        self.grid.neighbours(slot).any(|near| self.grid.get(near).state == State::Free)
    }

    /// Poses of all views that are not to be repeated.
    pub(crate) fn used(&self) -> impl Iterator<Item = &Pose> {
        self.used.iter().chain(&self.marked)
    }

    fn satisfied(&self, cell: &Cell) -> bool {
        cell.state == State::Occupied && cell.points as usize >= self.params.min_points
    }

    fn given_up(&self, cell: &Cell) -> bool {
        usize::from(cell.tries) >= self.params.max_tries
    }

    /// Whether a voxel is one of N: a surface that lacks points and may still get them.
    pub(crate) fn lacks_points(&self, cell: &Cell) -> bool {
        cell.state == State::Occupied && !self.satisfied(cell) && !self.given_up(cell)
    }

    /// Whether a voxel is one of M: hidden so far, where surface may be, and not looked at in vain too often.
    pub(crate) fn hides(&self, cell: &Cell) -> bool {
        cell.is_hidden() && (cell.near || self.params.hidden_reach == 0) && !self.given_up(cell)
    }

    /// Middle of the surface measured so far, object frame, metres; that of the region of interest if there is
    /// none. The outermost fiftieth on each side is left out as likely noise.
    pub(crate) fn middle(&self) -> Vec3 {
        let occupied = self.grid.iter().filter(|(_, cell)| cell.state == State::Occupied);
        let centers: Vec<Vec3> = occupied.map(|(slot, _)| self.grid.center(slot)).collect();
        if centers.is_empty() {
            return self.roi.center();
        }
        Vec3::from_fn(|axis, _| {
            let mut along: Vec<f64> = centers.iter().map(|c| c[axis]).collect();
            along.sort_unstable_by(f64::total_cmp);
            let cut = along.len() / 50;
            (along[cut] + along[along.len() - 1 - cut]) / 2.0
        })
    }

    fn apply(&mut self, carved: &Carved) {
        for &(slot, points) in &carved.hits {
            let cell = self.grid.get_mut(slot);
            if cell.state != State::Excluded {
                cell.points = cell.points.saturating_add(points);
                cell.hits = cell.hits.saturating_add(1);
            }
        }
        for slot in carved.freed.iter() {
            let cell = self.grid.get_mut(slot);
            cell.freed = true;
            if carved.passed.contains(slot) && !carved.hit.contains(slot) {
                cell.passes = cell.passes.saturating_add(1);
            }
        }
        for slot in carved.behind.iter() {
            self.grid.get_mut(slot).behind = true;
        }
    }

    /// Sets all states from the evidence: occupied before free before possible inside before possible border.
    fn judge(&mut self) {
        let slots: Vec<u32> = self.grid.iter().map(|(slot, _)| slot).collect();
        let mut hidden = Vec::new();
        for slot in slots {
            let hit_weight = self.params.hit_weight;
            let cell = self.grid.get_mut(slot);
            let surface =
                cell.hits > 0 && f64::from(cell.passes) <= hit_weight * f64::from(cell.hits);
            let state = match cell.state {
                State::Excluded => State::Excluded,
                _ if surface => State::Occupied,
                _ if cell.freed => State::Free,
                _ if cell.behind => State::PossibleInside,
                // Whether it still is a border is seen below.
                old => old,
            };
            if state == State::PossibleInside {
                hidden.push(slot);
            }
            if state != cell.state {
                cell.tries = if state == State::PossibleInside { cell.tries } else { 0 };
                cell.state = state;
            }
        }
        self.find_borders(&hidden);
        self.find_near();
        self.look_round_surface();
    }

    fn find_borders(&mut self, hidden: &[u32]) {
        let mut borders = SlotSet::new(self.grid.slots());
        for &slot in hidden {
            for next in self.grid.neighbours(slot) {
                let state = self.grid.get(next).state;
                if matches!(state, State::Unknown | State::PossibleBorder) {
                    borders.insert(next);
                }
            }
        }
        let old = self.grid.iter().filter(|(_, cell)| cell.state == State::PossibleBorder);
        let gone: Vec<u32> = old.map(|(slot, _)| slot).filter(|s| !borders.contains(*s)).collect();
        for slot in gone {
            self.grid.get_mut(slot).state = State::Unknown;
        }
        for slot in borders.iter() {
            self.grid.get_mut(slot).state = State::PossibleBorder;
        }
    }

    /// Marks the hidden voxels within reach of a surface voxel. A shadow goes on to the end of the region, the object
    /// does not: surface that was not seen yet adjoins what was seen.
    fn find_near(&mut self) {
        let reach = self.params.hidden_reach as i32;
        let row = |y: i32, z: i32| (-reach..=reach).map(move |x| [x, y, z]);
        let ball: Vec<Voxel> = (-reach..=reach)
            .flat_map(|z| (-reach..=reach).flat_map(move |y| row(y, z)))
            .filter(|[x, y, z]| x * x + y * y + z * z <= reach * reach)
            .collect();
        let mut near = SlotSet::new(self.grid.slots());
        for (slot, _) in self.grid.iter().filter(|(_, cell)| cell.state == State::Occupied) {
            let [x, y, z] = self.grid.voxel(slot);
            for [dx, dy, dz] in &ball {
                if let Some(slot) = self.grid.slot([x + dx, y + dy, z + dz]) {
                    near.insert(slot);
                }
            }
        }
        let hidden = self.grid.iter().filter(|(_, cell)| cell.is_hidden());
        let hidden: Vec<u32> = hidden.map(|(slot, _)| slot).collect();
        for slot in hidden {
            self.grid.get_mut(slot).near = near.contains(slot);
        }
    }

    /// Notes of each surface voxel which side is outward, and whether one that has its points touches it. A surface that
    /// cuts a corner off a voxel, or noise, leaves a few points beside those that show the same surface.
    fn look_round_surface(&mut self) {
        let mut beside = SlotSet::new(self.grid.slots());
        for (slot, _) in self.grid.iter().filter(|(_, cell)| self.satisfied(cell)) {
            let [x, y, z] = self.grid.voxel(slot);
            for i in 0..27 {
                if let Some(near) =
                    self.grid.slot([x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1])
                {
                    beside.insert(near);
                }
            }
        }
        let surface = self.grid.iter().filter(|(_, cell)| cell.state == State::Occupied);
        let surface: Vec<u32> = surface.map(|(slot, _)| slot).collect();
        for slot in surface {
            let outward = super::candidates::outward(self, slot);
            let cell = self.grid.get_mut(slot);
            cell.set_outward(outward);
            cell.beside = beside.contains(slot);
        }
    }

    /// Looks at the space from where the scan was taken: what still asks there was looked at in vain, unless it
    /// got points. Only what a candidate's simulated scan would count gets a try, so that no view can gain for
    /// ever.
    fn note_looks(&mut self, carved: &Carved, pose: &Pose) {
        let eye = Eye::new(&self.sensor, self.edge() / 2.0);
        let mut seen = SlotSet::new(self.grid.slots());
        let (mut vain, mut measured) = (Vec::new(), Vec::new());
        look(self, &eye, pose, &mut seen, |slot, cell, along| {
            if cell.state == State::Occupied && carved.hit.contains(slot) {
                measured.push((slot, *along));
            } else if self.lacks_points(cell) || self.hides(cell) {
                vain.push(slot);
            }
        });
        for slot in vain {
            let cell = self.grid.get_mut(slot);
            cell.tries = cell.tries.saturating_add(1);
        }
        for (slot, along) in measured {
            let Some(normal) = super::candidates::outward(self, slot) else { continue };
            let quality = (-along.dot(&normal)).clamp(0.0, 1.0) * 255.0;
            let cell = self.grid.get_mut(slot);
            cell.quality = cell.quality.max(quality as u8);
        }
    }
}

fn check(scan: &Scan, pose: &Pose) -> Result<()> {
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
