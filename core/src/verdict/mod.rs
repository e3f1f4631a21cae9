//! The verdict on a finished mesh: whether it represents what was measured.
//!
//! A mesh can be closed, and near the truth wherever it is, while it leaves most of the object out.
//! Two shares reveal that without ground truth: the share of the scans that were accepted, and the
//! share of the measured surface that the mesh lies on. Below one half of either, the measurements
//! contradict the mesh more than they support it.
//!
//! ```
//! use puffer_core::verdict::{ModelVerdict, ScanCount};
//!
//! let verdict = ModelVerdict { scans: ScanCount::new(10, 4), cells_explained: Some(0.97) };
//! let reason = verdict.distrust_reason().unwrap_or_default();
//! assert!(reason.contains("only 4 of 10 scans"));
//! ```

mod explained_cells;
#[cfg(test)]
mod tests;

pub use explained_cells::explained_share;

use crate::geometry::Cloud;
use crate::mesh::Mesh;
use crate::register;
use serde_json::{Map, Value, json};

/// Least share of the scans and of the cells with which a mesh is trusted: below it, more of the
/// measurements contradict the mesh than support it, for any sensor and object.
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

    /// Counts the verdicts on scans, one for each scan that came; `None` if none came.
    pub fn from_verdicts(verdicts: &[register::Verdict]) -> Option<ScanCount> {
        let accepted = verdicts.iter().filter(|v| v.is_accepted()).count();
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

/// How well a mesh and the measurements agree, as far as it is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ModelVerdict {
    /// The scans; `None` where there are none to count, as for a single cloud.
    pub scans: Option<ScanCount>,
    /// Share of the cloud's cells that the mesh explains, 0 to 1 ([`explained_share`]);
    /// `None` without a mesh.
    pub cells_explained: Option<f64>,
}

impl ModelVerdict {
    /// The verdict on `mesh`, which was made of `cloud`, which was made of `scans`.
    pub fn new(scans: Option<ScanCount>, cloud: &Cloud, mesh: &Mesh) -> ModelVerdict {
        ModelVerdict { scans, cells_explained: explained_share(cloud, mesh) }
    }

    /// Why the mesh is not to be trusted, in one sentence that says what to do; `None` if it is.
    pub fn distrust_reason(&self) -> Option<String> {
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

    /// The verdict and its shares in words, for logs.
    pub fn summary(&self) -> String {
        let scans = self.scans.map(|scans| {
            format!(
                "{} of {} scans accepted ({:.1} %)",
                scans.accepted,
                scans.all,
                100.0 * scans.share()
            )
        });
        let cells = self
            .cells_explained
            .map(|share| format!("{:.1} % of the measured surface explained", 100.0 * share));
        let parts: Vec<String> = scans.into_iter().chain(cells).collect();
        let word = if self.distrust_reason().is_none() { "trustworthy" } else { "NOT trustworthy" };
        if parts.is_empty() {
            "nothing to judge".into()
        } else {
            format!("{word}: {}", parts.join(", "))
        }
    }

    /// The verdict as reports and JSON hold it; null is what is not known.
    pub fn to_json(&self) -> Map<String, Value> {
        let distrust = self.distrust_reason();
        let fields = [
            ("scans", json!(self.scans.map(|scans| scans.all))),
            ("accepted", json!(self.scans.map(|scans| scans.accepted))),
            ("share_of_scans_accepted", json!(self.scans.map(|scans| scans.share()))),
            ("share_of_cells_explained", json!(self.cells_explained)),
            ("trustworthy", json!(distrust.is_none())),
            ("not_trustworthy_because", json!(distrust)),
        ];
        fields.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
    }

    /// Reads the verdict from a report that contains the fields of [`ModelVerdict::to_json`].
    pub fn from_json(report: &Map<String, Value>) -> ModelVerdict {
        let scans = count(report, "scans").zip(count(report, "accepted"));
        ModelVerdict {
            scans: scans.and_then(|(all, accepted)| ScanCount::new(all, accepted)),
            cells_explained: report.get("share_of_cells_explained").and_then(Value::as_f64),
        }
    }
}

/// The count in the field `key`; `None` if there is none.
fn count(report: &Map<String, Value>, key: &str) -> Option<usize> {
    report.get(key)?.as_u64().map(|count| count as usize)
}
