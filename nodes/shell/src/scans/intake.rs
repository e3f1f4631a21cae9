//! All scans that came, registered.

use super::RegistrarParams;
use super::observation::{Cut, Observation};
use crate::Stamp;
use puffer_core::geometry::{Pose, Scan};
use puffer_core::register::{PreparedScan, Registrar, Registration, Status, Verdict, register};
use puffer_core::scans::View;
use puffer_core::{Progress, Result};

/// Registers observations in the order in which they come.
pub struct Intake {
    params: RegistrarParams,
    registrar: Registrar,
    entries: Vec<Entry>,
    /// Versions told before the first of these scans.
    versions_before: u32,
}

/// One scan.
struct Entry {
    observation: Observation,
    /// What counts as the object, at the pose known last, and what does not.
    cut: Cut,
    /// Its number in the registrar, or why it has none.
    place: std::result::Result<usize, String>,
    version: u32,
}

/// A scan as it stands.
pub struct Registered<'a> {
    /// Grows with whatever new is said of it.
    pub version: u32,
    /// When it was taken.
    pub stamp: Stamp,
    /// The sensor's frame.
    pub frame: &'a str,
    /// What counts as the object, sensor frame.
    pub scan: &'a Scan,
    /// Some of what does not, sensor frame.
    pub beyond: &'a Scan,
    /// What the robot said.
    pub prior: Pose,
    /// Estimated `object_from_sensor`.
    pub pose: Pose,
    /// What became of it; none if it shows too little to be registered.
    pub verdict: Option<&'a Verdict>,
    /// Why there is no verdict.
    pub reason: &'a str,
}

impl Registered<'_> {
    /// Whether it joins the model.
    pub fn status(&self) -> Status {
        self.verdict.map_or(Status::Refused, |verdict| verdict.status)
    }
}

impl Intake {
    /// Without scans.
    pub fn new(params: RegistrarParams) -> Intake {
        let registrar = Registrar::new(params.scan.pose_sigma(), params.register.clone());
        Intake { params, registrar, entries: Vec::new(), versions_before: 0 }
    }

    /// Forgets all scans. Versions go on from theirs, so that a scan told before is not taken for one of the same number
    /// that comes now.
    pub fn restart(&mut self, params: RegistrarParams) {
        let newest = self.entries.iter().map(|entry| entry.version).max();
        let versions_before = newest.unwrap_or(self.versions_before);
        *self = Intake { versions_before, ..Intake::new(params) };
    }

    /// Number of scans.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Takes a scan; the numbers of those whose pose or verdict is new, this one first.
    pub fn add(&mut self, observation: Observation) -> Vec<usize> {
        let id = self.entries.len();
        let cut = observation.before_registration(&self.params.scan);
        let prepared = PreparedScan::new(&cut.object);
        let place = match &prepared {
            Ok(prepared) if prepared.points.len() >= LEAST_POINTS => Ok(self.registrar.len()),
            Ok(prepared) => Err(format!(
                "only {} points of a surface may be the object's, {LEAST_POINTS} are needed",
                prepared.points.len()
            )),
            Err(error) => Err(error.to_string()),
        };
        let good = place.is_ok();
        let version = self.versions_before + 1;
        self.entries.push(Entry { observation, cut, place, version });
        let (Ok(prepared), true) = (prepared, good) else { return vec![id] };
        let changed = self.registrar.add(&prepared, &self.entries[id].observation.prior);
        let ids: Vec<usize> = changed.into_iter().filter_map(|place| self.id_of(place)).collect();
        for &id in &ids {
            self.cut_again(id);
            self.entries[id].version += u32::from(id != ids[0]);
        }
        ids
    }

    /// Counts a scan of the sensor `frame` that cannot be used, and why; its number.
    pub fn add_unusable(&mut self, stamp: Stamp, frame: &str, reason: String) -> usize {
        let observation = Observation::nothing(stamp, frame);
        let (cut, place) = (Cut::default(), Err(reason));
        let version = self.versions_before + 1;
        self.entries.push(Entry { observation, cut, place, version });
        self.entries.len() - 1
    }

    /// Once a pose is known, less has to be cut for caution.
    fn cut_again(&mut self, id: usize) {
        let entry = &mut self.entries[id];
        let Ok(place) = entry.place else { return };
        if self.registrar.verdict(place).status != Status::Accepted {
            return;
        }
        entry.cut = entry.observation.at(&self.registrar.pose(place), &self.params.scan);
    }

    fn id_of(&self, place: usize) -> Option<usize> {
        self.entries.iter().position(|entry| entry.place == Ok(place))
    }

    /// Scan `id` as it stands.
    pub fn scan(&self, id: usize) -> Registered<'_> {
        let entry = &self.entries[id];
        let observation = &entry.observation;
        let (pose, verdict, reason) = match &entry.place {
            Ok(place) => {
                let verdict = self.registrar.verdict(*place);
                (self.registrar.pose(*place), Some(verdict), verdict.reason.as_str())
            }
            Err(reason) => (observation.prior, None, reason.as_str()),
        };
        let (stamp, prior) = (observation.stamp, observation.prior);
        let frame = observation.frame.as_str();
        let Cut { object, beyond } = &entry.cut;
        let version = entry.version;
        Registered { version, stamp, frame, scan: object, beyond, prior, pose, verdict, reason }
    }

    /// The numbers of the scans that are accepted, ascending, and the version of each.
    pub fn accepted(&self) -> (Vec<u32>, Vec<u32>) {
        let scans = (0..self.entries.len()).map(|id| (id, self.scan(id)));
        let accepted = scans.filter(|(_, scan)| scan.status() == Status::Accepted);
        accepted.map(|(id, scan)| (id as u32, scan.version)).unzip()
    }

    /// The numbers of the scans that can be registered, in the order of [`Intake::refine`]'s lists.
    pub fn usable(&self) -> Vec<usize> {
        (0..self.entries.len()).filter(|&id| self.entries[id].place.is_ok()).collect()
    }

    /// The usable scans with the robot's poses, as a scan folder holds them.
    pub fn views(&self) -> Vec<View> {
        let view = |id: usize| View {
            name: format!("view_{id:03}"),
            scan: self.entries[id].cut.object.clone(),
            object_from_sensor: self.entries[id].observation.prior,
        };
        self.usable().into_iter().map(view).collect()
    }

    /// Registers all usable scans together and cuts each again at its pose: in all poses together the robot's errors
    /// have averaged out, so that only now the bodies stand where they are.
    ///
    /// # Errors
    /// As [`register`].
    pub fn settle(&mut self, progress: &Progress) -> Result<()> {
        self.registrar.refine(progress)?;
        for id in self.usable() {
            self.cut_again(id);
            self.entries[id].version += 1;
        }
        Ok(())
    }

    /// Settles, and optimises the poses of all usable scans once more with the points that are left: exactly what is
    /// made of a scan folder with [`Intake::views`].
    ///
    /// # Errors
    /// As [`register`].
    pub fn refine(&mut self, progress: &Progress) -> Result<Registration> {
        self.settle(progress)?;
        let views = self.views();
        let scans: Vec<PreparedScan> =
            views.iter().map(|view| PreparedScan::new(&view.scan)).collect::<Result<_>>()?;
        let robot: Vec<Pose> = views.iter().map(|view| view.object_from_sensor).collect();
        let sigma = Some(self.params.scan.pose_sigma());
        let registration = register(&scans, &robot, sigma, &self.params.register, progress)?;
        self.registrar.adopt(&registration);
        Ok(registration)
    }
}

/// Oriented points without which a scan shows no surface worth registering.
const LEAST_POINTS: usize = 100;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_restart_forgets_the_scans_but_not_the_versions() {
        let mut intake = Intake::new(RegistrarParams::default());
        let add = |intake: &mut Intake| {
            let id = intake.add_unusable(Stamp::default(), "camera", "no transform".to_owned());
            (id, intake.scan(id).version)
        };
        assert_eq!([add(&mut intake), add(&mut intake)], [(0, 1), (1, 1)]);
        intake.restart(RegistrarParams::default());
        assert!(intake.is_empty());
        assert_eq!(add(&mut intake), (0, 2));
        intake.restart(RegistrarParams::default());
        intake.restart(RegistrarParams::default());
        assert_eq!(add(&mut intake), (0, 3));
        assert_eq!(intake.accepted(), (vec![], vec![]));
    }
}
