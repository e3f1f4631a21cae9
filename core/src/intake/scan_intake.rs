//! All scans that arrived, registered.

use super::observation::{Observation, ScanLabel, SplitScan};
use super::params::IntakeParams;
use crate::geometry::{Pose, Scan};
use crate::register::{Registrar, Registration, Status, Verdict, register};
use crate::scan::PreparedScan;
use crate::scan_files::View;
use crate::{Progress, Result};

/// Oriented points without which a scan shows no surface worth registering: with fewer, the normals
/// of three independent directions are not determined.
const MIN_SURFACE_POINTS: usize = 100;

/// Registers observations in the order in which they arrive.
pub struct Intake {
    params: IntakeParams,
    registrar: Registrar,
    entries: Vec<IntakeEntry>,
    /// The newest version that was given out before the first of `entries`.
    versions_before: u32,
}

/// One scan.
struct IntakeEntry {
    observation: Observation,
    /// Object and rest, cut at the pose known last.
    split: SplitScan,
    /// The scan's number in the registrar, or why it has none.
    registrar_index: std::result::Result<usize, String>,
    version: u32,
}

/// What is known of one scan now.
pub struct ScanState<'a> {
    /// Grows whenever the pose, the verdict or the points of the scan change.
    pub version: u32,
    /// When it was taken, and in which sensor frame.
    pub label: &'a ScanLabel,
    /// The points that count as the object's, sensor frame.
    pub object: &'a Scan,
    /// Some of the other points, sensor frame.
    pub beyond: &'a Scan,
    /// The robot's `object_from_sensor`.
    pub prior: Pose,
    /// Estimated `object_from_sensor`.
    pub pose: Pose,
    /// The verdict on the registration; none if the scan shows too little to be registered.
    pub verdict: Option<&'a Verdict>,
    /// The verdict's reason, or why there is no verdict.
    pub reason: &'a str,
}

impl ScanState<'_> {
    /// Whether the scan joins the model.
    pub fn status(&self) -> Status {
        self.verdict.map_or(Status::Refused, |verdict| verdict.status)
    }
}

impl Intake {
    /// An intake without scans.
    pub fn new(params: IntakeParams) -> Intake {
        let registrar = Registrar::new(params.cut.pose_sigma, params.register.clone());
        Intake { params, registrar, entries: Vec::new(), versions_before: 0 }
    }

    /// Forgets all scans. Versions continue from theirs, so that an earlier scan is not confused
    /// with a new one of the same number.
    pub fn restart(&mut self, params: IntakeParams) {
        let newest = self.entries.iter().map(|entry| entry.version).max();
        let versions_before = newest.unwrap_or(self.versions_before);
        *self = Intake { versions_before, ..Intake::new(params) };
    }

    /// Number of scans.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether there is no scan.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Takes a scan and registers it if it shows enough. Returns the ids of the scans whose pose or
    /// verdict is new: this one first, then those that could be registered only now.
    pub fn add(&mut self, observation: Observation) -> Vec<usize> {
        let id = self.entries.len();
        let split = observation.split_at_prior(&self.params.cut);
        let prior = observation.prior;
        let prepared = prepare_surface(&split.object);
        let (registrar_index, prepared) = match prepared {
            Ok(prepared) => (Ok(self.registrar.len()), Some(prepared)),
            Err(reason) => (Err(reason), None),
        };
        let version = self.versions_before + 1;
        self.entries.push(IntakeEntry { observation, split, registrar_index, version });
        let Some(prepared) = prepared else { return vec![id] };
        let changed = self.registrar.add(&prepared, &prior);
        let ids: Vec<usize> = changed.into_iter().filter_map(|index| self.id_of(index)).collect();
        for &id in &ids {
            self.split_at_estimate(id);
            self.entries[id].version += u32::from(id != ids[0]);
        }
        ids
    }

    /// Counts a scan that cannot be used, with the reason. Returns its id.
    pub fn add_unusable(&mut self, label: ScanLabel, reason: String) -> usize {
        self.entries.push(IntakeEntry {
            observation: Observation::without_points(label),
            split: SplitScan::default(),
            registrar_index: Err(reason),
            version: self.versions_before + 1,
        });
        self.entries.len() - 1
    }

    /// Cuts an accepted scan again at its estimated pose, where bodies need no margin for the error
    /// of the robot's pose.
    fn split_at_estimate(&mut self, id: usize) {
        let entry = &mut self.entries[id];
        let Ok(index) = entry.registrar_index else { return };
        if self.registrar.verdict(index).is_accepted() {
            let pose = self.registrar.pose(index);
            entry.split = entry.observation.split_at(&pose, &self.params.cut);
        }
    }

    fn id_of(&self, registrar_index: usize) -> Option<usize> {
        self.entries.iter().position(|entry| entry.registrar_index == Ok(registrar_index))
    }

    /// What is known of scan `id` now.
    pub fn state(&self, id: usize) -> ScanState<'_> {
        let entry = &self.entries[id];
        let (pose, verdict, reason) = match &entry.registrar_index {
            Ok(index) => {
                let verdict = self.registrar.verdict(*index);
                (self.registrar.pose(*index), Some(verdict), verdict.reason.as_str())
            }
            Err(reason) => (entry.observation.prior, None, reason.as_str()),
        };
        ScanState {
            version: entry.version,
            label: &entry.observation.label,
            object: &entry.split.object,
            beyond: &entry.split.beyond,
            prior: entry.observation.prior,
            pose,
            verdict,
            reason,
        }
    }

    /// The ids of the accepted scans, ascending, and the version of each.
    pub fn accepted(&self) -> (Vec<u32>, Vec<u32>) {
        (0..self.entries.len())
            .map(|id| (id as u32, self.state(id)))
            .filter(|(_, state)| state.status().is_accepted())
            .map(|(id, state)| (id, state.version))
            .unzip()
    }

    /// The ids of the scans that can be registered, in the order of the lists of
    /// [`Intake::refine`].
    pub fn usable_ids(&self) -> Vec<usize> {
        (0..self.entries.len()).filter(|&id| self.entries[id].registrar_index.is_ok()).collect()
    }

    /// The usable scans with the robot's poses, as a scan folder holds them.
    pub fn views(&self) -> Vec<View> {
        self.usable_ids()
            .into_iter()
            .map(|id| View {
                name: format!("view_{id:03}"),
                scan: self.entries[id].split.object.clone(),
                object_from_sensor: self.entries[id].observation.prior,
            })
            .collect()
    }

    /// Registers all usable scans together and cuts each accepted one again at its pose: over all
    /// poses the robot's errors have averaged out, so that only now the bodies are where they were.
    ///
    /// # Errors
    /// As [`register`].
    pub fn settle(&mut self, progress: &Progress) -> Result<()> {
        self.registrar.refine(progress)?;
        for id in self.usable_ids() {
            self.split_at_estimate(id);
            self.entries[id].version += 1;
        }
        Ok(())
    }

    /// Settles, then registers all usable scans once more with the points that are left: exactly
    /// what is made of a scan folder with [`Intake::views`]. The scans are prepared again for this,
    /// because the points that are left have other neighbours.
    ///
    /// # Errors
    /// As [`register`].
    pub fn refine(&mut self, progress: &Progress) -> Result<Registration> {
        self.settle(progress)?;
        let usable: Vec<&IntakeEntry> =
            self.entries.iter().filter(|entry| entry.registrar_index.is_ok()).collect();
        let scans: Vec<PreparedScan> = usable
            .iter()
            .map(|entry| PreparedScan::new(&entry.split.object))
            .collect::<Result<_>>()?;
        let robot: Vec<Pose> = usable.iter().map(|entry| entry.observation.prior).collect();
        let sigma = Some(self.params.cut.pose_sigma);
        let registration = register(&scans, &robot, sigma, &self.params.register, progress)?;
        self.registrar.adopt(&registration);
        Ok(registration)
    }
}

/// Prepares the points that may be the object's; says why if they show too little of a surface.
fn prepare_surface(object: &Scan) -> std::result::Result<PreparedScan, String> {
    let prepared = PreparedScan::new(object).map_err(|error| error.to_string())?;
    if prepared.points.len() < MIN_SURFACE_POINTS {
        return Err(format!(
            "only {} points of a surface may be the object's, {MIN_SURFACE_POINTS} are needed",
            prepared.points.len()
        ));
    }
    Ok(prepared)
}
