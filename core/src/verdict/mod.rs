//! The verdict on the whole: whether a mesh stands for what was measured.
//!
//! A mesh can be closed, and near the truth wherever it is, while it leaves most of the object out.
//! Two shares tell, without any truth: that of the scans that were accepted, and that of the
//! measured surface that the mesh lies on. Below one half of either, what was measured speaks
//! against the mesh rather than for it.

mod explained;
#[cfg(test)]
mod tests;

pub use explained::share_of_cells_explained;

use crate::geometry::Cloud;
use crate::mesh::Mesh;
use crate::register::{self, Status};
use serde_json::{Map, Value, json};

/// Least share of the scans and of the cells with which a mesh is trusted: below it, more of what
/// was measured speaks against the mesh than for it, whatever sensor and object are.
pub const MIN_TRUSTED_SHARE: f64 = 0.5;

/// How many scans came, and how many of them were accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScanCount {
    /// Scans that came, at least 1.
    all: usize,
    /// Those of them that joined the model.
    accepted: usize,
}

impl ScanCount {
    /// `accepted` scans of `all`; `None` if none came: there is nothing to take a share of.
    pub fn new(all: usize, accepted: usize) -> Option<ScanCount> {
        (all > 0).then_some(ScanCount { all, accepted })
    }

    /// Counts the verdicts on scans, one for each scan that came.
    pub fn from_verdicts(verdicts: &[register::Verdict]) -> Option<ScanCount> {
        let accepted = verdicts.iter().filter(|v| v.status == Status::Accepted).count();
        ScanCount::new(verdicts.len(), accepted)
    }

    /// Scans that came.
    pub fn all(&self) -> usize {
        self.all
    }

    /// Those of them that were accepted.
    pub fn accepted(&self) -> usize {
        self.accepted
    }

    /// Share of the scans that were accepted, 0 to 1.
    pub fn share(&self) -> f64 {
        self.accepted as f64 / self.all as f64
    }
}

/// What is known of how well a mesh and the measurements go together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ModelVerdict {
    /// The scans; `None` where there are none to count, as for a single cloud.
    pub scans: Option<ScanCount>,
    /// Share of the cloud's cells that the mesh explains, 0 to 1 ([`share_of_cells_explained`]);
    /// `None` without a mesh.
    pub cells_explained: Option<f64>,
}

impl ModelVerdict {
    /// The verdict on `mesh`, which was made of `cloud`, which was made of `scans`.
    pub fn new(scans: Option<ScanCount>, cloud: &Cloud, mesh: &Mesh) -> ModelVerdict {
        ModelVerdict { scans, cells_explained: share_of_cells_explained(cloud, mesh) }
    }

    /// Why the mesh is not to be trusted, in one sentence that says what to do; `None` if it is.
    pub fn distrust(&self) -> Option<String> {
        let mut reasons = Vec::new();
        if let Some(scans) = self.scans.filter(|scans| scans.share() < MIN_TRUSTED_SHARE) {
            reasons.push(format!(
                "only {} of {} scans ({:.1} %) were accepted, and at least half must be: see the verdict on each scan, \
                 and check how the sensor is mounted, the pose error that the robot is said to have, and that the \
                 object does not move",
                scans.accepted,
                scans.all,
                100.0 * scans.share()
            ));
        }
        if let Some(share) = self.cells_explained.filter(|share| *share < MIN_TRUSTED_SHARE) {
            reasons.push(format!(
                "the mesh lies on only {:.1} % of the surface that was measured, and at least half must be explained: \
                 take more scans of the object, check their poses, or let the mesh follow thinner parts (a smaller \
                 reconstruct.edge_length) and more bodies (reconstruct.components)",
                100.0 * share
            ));
        }
        (!reasons.is_empty())
            .then(|| format!("the model is not trustworthy: {}", reasons.join("; and ")))
    }

    /// The shares, in words.
    pub fn summary(&self) -> String {
        let percent = |share: f64| format!("{:.1} %", 100.0 * share);
        let scans = self.scans.map(|scans| {
            format!(
                "{} of {} scans accepted ({})",
                scans.accepted,
                scans.all,
                percent(scans.share())
            )
        });
        let cells = self
            .cells_explained
            .map(|share| format!("{} of the measured surface explained", percent(share)));
        let parts: Vec<String> = scans.into_iter().chain(cells).collect();
        let word = if self.distrust().is_none() { "trustworthy" } else { "NOT trustworthy" };
        if parts.is_empty() {
            "nothing to judge".into()
        } else {
            format!("{word}: {}", parts.join(", "))
        }
    }

    /// The verdict as reports and JSON have it; null is what is not known.
    pub fn facts(&self) -> Map<String, Value> {
        let distrust = self.distrust();
        let facts = [
            ("scans", json!(self.scans.map(|scans| scans.all))),
            ("accepted", json!(self.scans.map(|scans| scans.accepted))),
            ("share_of_scans_accepted", json!(self.scans.map(|scans| scans.share()))),
            ("share_of_cells_explained", json!(self.cells_explained)),
            ("trustworthy", json!(distrust.is_none())),
            ("not_trustworthy_because", json!(distrust)),
        ];
        facts.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
    }

    /// The verdict that a report with [`ModelVerdict::facts`] tells.
    pub fn from_facts(facts: &Map<String, Value>) -> ModelVerdict {
        let count = |key: &str| facts.get(key)?.as_u64();
        let scans = count("scans").zip(count("accepted"));
        ModelVerdict {
            scans: scans
                .and_then(|(all, accepted)| ScanCount::new(all as usize, accepted as usize)),
            cells_explained: facts.get("share_of_cells_explained").and_then(Value::as_f64),
        }
    }
}
