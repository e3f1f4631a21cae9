//! How good a mesh is: one definition of each figure for all.
//!
//! Distances are exact from samples to triangles. cRMS is the distance of the result's samples to the truth after
//! point-to-plane ICP from the identity (Wiedemann 2014, §3); all other distances are taken after the same
//! alignment, and once more before it.

mod align;
mod calibration;
mod distances;
#[cfg(test)]
mod filter_tests;
mod filtering;
mod perturb;
#[cfg(test)]
mod pose_tests;
mod poses;
mod reference;
mod returned;
mod sample;
mod stats;
#[cfg(test)]
mod tests;
mod topology;
mod trials;

pub use align::{Alignment, align};
pub use calibration::{Calibration, calibration};
pub use distances::{Distances, RawDistances, Spread};
pub use filtering::{FilterFigures, filter_figures};
pub use perturb::{differences, perturbed};
pub use poses::{PoseErrors, PosedHits, pair_error, pose_errors};
pub use reference::{Nearest, Reference, distance_to_open_truth};
pub use returned::{PosedReference, Returned};
pub use sample::{Sample, sample_surface};
pub use stats::quantile;
pub use topology::{Topology, topology};
pub use trials::{Trial, TrialKind, TrialScan, trial_scans, trials};

use crate::geometry::{KdTree, Pose, Vec3};
use crate::mesh::{Mesh, invariants};
use crate::{Error, Progress, Result};
use align::apply;
use distances::{MM, OneWay};
use reference::covered;
use serde::Serialize;
use stats::{rms, share};

/// What to measure with.
#[derive(Clone, Debug)]
pub struct AssessParams {
    /// Area-uniform samples each way.
    pub samples: usize,
    /// Seed of the samples.
    pub seed: u64,
    /// Points of the truth that the scans saw (noise-free hits, metres, the truth's frame).
    pub seen: Option<Vec<Vec3>>,
    /// Standard deviation of the surface's noise, metres, for the double surface; `None`: the robust spread of the
    /// distances themselves (1.4826 times their median).
    pub noise_sigma: Option<f64>,
}

impl Default for AssessParams {
    fn default() -> Self {
        // 100,000 samples: the mean of a distance is known to about 0.3 % of its spread.
        AssessParams { samples: 100_000, seed: 0, seen: None, noise_sigma: None }
    }
}

/// Every figure of a mesh against the truth. Lengths in mm, angles in degrees; `None` and NaN become null in JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Assessment {
    /// Gates and shape of the triangles.
    #[serde(flatten)]
    pub topology: Topology,
    /// Mean distance of the result's samples to the truth, aligned.
    pub crms_mean: f64,
    /// Its root mean square.
    pub crms_rms: f64,
    /// Samples that the alignment rests on: those whose nearest truth point is not on a boundary of the truth.
    pub correspondences: usize,
    /// All distances, aligned.
    #[serde(flatten)]
    pub aligned: Distances,
    /// Share of the result farther than 3 sigma from the truth, inside or outside.
    pub double_surface: f64,
    /// The sigma used for that.
    pub double_surface_sigma: f64,
    /// Share of the truth farther than 2 mm from the result.
    pub holes: f64,
    /// Share of the truth that the scans saw.
    pub seen_share: Option<f64>,
    /// Completeness on the part that the scans saw, mean.
    pub completeness_seen_mean: Option<f64>,
    /// Its root mean square.
    pub completeness_seen_rms: Option<f64>,
    /// 90 % are nearer.
    pub completeness_seen_90: Option<f64>,
    /// Share of the part that the scans saw farther than 2 mm from the result.
    pub holes_seen: Option<f64>,
    /// Open truth: share of the result's samples whose nearest truth point is not on the truth's boundary.
    pub covered_share: Option<f64>,
    /// Open truth: accuracy of those, mean.
    pub accuracy_covered_mean: Option<f64>,
    /// Its root mean square.
    pub accuracy_covered_rms: Option<f64>,
    /// 90 % are nearer.
    pub accuracy_covered_90: Option<f64>,
    /// Share of the observed vertices whose error is at most sigma.
    pub within_1_sigma: Option<f64>,
    /// Share of the observed vertices whose error is at most 2 sigma.
    pub within_2_sigma: Option<f64>,
    /// Spearman's correlation of sigma and the size of the error.
    pub sigma_rank_correlation: Option<f64>,
    /// Mean signed error of the observed vertices, positive outside.
    pub error_bias: Option<f64>,
    /// Mean sigma of the observed vertices.
    pub sigma_mean: Option<f64>,
    /// Observed vertices with a sigma.
    pub calibration_vertices: usize,
    /// Length of the shift that the alignment made.
    pub alignment_translation: f64,
    /// Angle of the turn that the alignment made.
    pub alignment_rotation: f64,
    /// Diagonal of the truth's bounding box.
    pub diagonal: f64,
    /// All distances before the alignment.
    #[serde(flatten)]
    pub raw: RawDistances,
}

/// Measures `result` against `truth`, both in metres and in the same frame.
///
/// The alignment is dropped if it makes the root mean square distance a tenth larger (an ICP that ran away).
///
/// # Errors
/// [`Error::Input`] if a mesh has no area, a coordinate that is not finite or an index out of range, or if
/// no sample is asked for; [`Error::Cancelled`].
pub fn assess(
    result: &Mesh,
    truth: &Mesh,
    params: &AssessParams,
    progress: &Progress,
) -> Result<Assessment> {
    check(result, "result")?;
    check(truth, "truth")?;
    if params.samples == 0 {
        return Err(Error::input("0 samples measure nothing: ask for 1 or more (100000 is usual)"));
    }
    progress.report("assess", 0.0)?;
    let pair = Pair::new(result, truth, params)?;
    let raw = pair.measure(&Pose::identity());
    progress.report("assess", 0.2)?;
    let points: Vec<Vec3> = pair.result_samples.iter().map(|s| s.point).collect();
    let pose = align(&points, &pair.truth, progress)?.pose;
    progress.report("assess", 0.5)?;
    let mut aligned = pair.measure(&pose);
    // Minimising the part along the normals may cost a little in the whole distance; more is a failure.
    if rms(&aligned.accuracy()) > 1.1 * rms(&raw.accuracy()) {
        aligned = pair.measure(&Pose::identity());
    }
    progress.report("assess", 0.7)?;
    let topology = topology(result);
    progress.report("assess", 0.8)?;
    let calibration = calibration(result, &pair.truth, progress)?;
    progress.report("assess", 1.0)?;
    Ok(pair.assessment(params, topology, &raw, &aligned, calibration))
}

/// Both surfaces with their samples.
struct Pair {
    result: Reference,
    truth: Reference,
    result_samples: Vec<Sample>,
    truth_samples: Vec<Sample>,
    diagonal: f64,
    truth_area: f64,
    truth_is_open: bool,
}

/// Nearest points both ways under one pose.
struct Measured {
    pose: Pose,
    /// Of the result's samples on the truth.
    there: Vec<Nearest>,
    /// Of the truth's samples on the result.
    back: Vec<Nearest>,
}

impl Measured {
    fn accuracy(&self) -> Vec<f64> {
        self.there.iter().map(|n| n.distance).collect()
    }

    fn completeness(&self) -> Vec<f64> {
        self.back.iter().map(|n| n.distance).collect()
    }
}

impl Pair {
    fn new(result: &Mesh, truth: &Mesh, params: &AssessParams) -> Result<Pair> {
        Ok(Pair {
            result: Reference::new(result)?,
            truth: Reference::new(truth)?,
            result_samples: sample_surface(result, params.samples, params.seed, 0)?,
            truth_samples: sample_surface(truth, params.samples, params.seed, 1)?,
            diagonal: truth.aabb().diagonal(),
            truth_area: truth.area(),
            truth_is_open: !invariants::is_closed(truth),
        })
    }

    /// Rather than the result's surface, the truth's samples are moved back.
    fn measure(&self, truth_from_result: &Pose) -> Measured {
        let moved = |samples: &[Sample], pose: &Pose| -> Vec<Vec3> {
            samples.iter().map(|s| apply(pose, &s.point)).collect()
        };
        let back = truth_from_result.inverse();
        Measured {
            pose: *truth_from_result,
            there: self.truth.nearest_all(&moved(&self.result_samples, truth_from_result)),
            back: self.result.nearest_all(&moved(&self.truth_samples, &back)),
        }
    }

    fn distances(&self, measured: &Measured) -> Distances {
        let back_pose = measured.pose.inverse();
        let there = OneWay {
            samples: &self.result_samples,
            nearest: &measured.there,
            pose: &measured.pose,
        };
        let back =
            OneWay { samples: &self.truth_samples, nearest: &measured.back, pose: &back_pose };
        Distances::of(&there, &back, self.diagonal)
    }

    /// Distances to the result from the truth's samples that lie near a seen point.
    fn seen(&self, measured: &Measured, seen: &[Vec3]) -> Vec<f64> {
        let spacing = (self.truth_area / self.truth_samples.len() as f64).sqrt();
        let tree = KdTree::new(seen);
        let near = |s: &Sample| tree.nearest_within(&s.point, 2.0 * spacing).is_some();
        let pairs = self.truth_samples.iter().zip(&measured.back);
        pairs.filter(|(s, _)| near(s)).map(|(_, n)| n.distance).collect()
    }

    fn assessment(
        &self,
        params: &AssessParams,
        topology: Topology,
        raw: &Measured,
        measured: &Measured,
        calibration: Option<Calibration>,
    ) -> Assessment {
        let aligned = self.distances(measured);
        let accuracy = measured.accuracy();
        // Below this a spread is rounding, not noise.
        let least = 1e-6 * self.diagonal;
        let sigma = params.noise_sigma.unwrap_or(1.4826 * quantile(&accuracy, 0.5)).max(least);
        let hole = |d: f64| d > 0.002;
        let seen = params.seen.as_ref().map(|seen| self.seen(measured, seen));
        let seen_spread = seen.as_deref().and_then(Spread::of);
        let covered = self.truth_is_open.then(|| covered(&measured.there));
        let covered_spread = covered.as_deref().and_then(Spread::of);
        let part = |d: &Vec<f64>| d.len() as f64 / params.samples as f64;
        Assessment {
            topology,
            crms_mean: aligned.accuracy_mean,
            crms_rms: aligned.accuracy_rms,
            correspondences: measured.there.iter().filter(|n| !n.on_boundary).count(),
            aligned,
            double_surface: share(&accuracy, |d| d > 3.0 * sigma),
            double_surface_sigma: MM * sigma,
            holes: share(&measured.completeness(), hole),
            seen_share: seen.as_ref().map(part),
            completeness_seen_mean: seen_spread.map(|s| s.mean),
            completeness_seen_rms: seen_spread.map(|s| s.rms),
            completeness_seen_90: seen_spread.map(|s| s.p90),
            holes_seen: seen.as_deref().filter(|s| !s.is_empty()).map(|s| share(s, hole)),
            covered_share: covered.as_ref().map(part),
            accuracy_covered_mean: covered_spread.map(|s| s.mean),
            accuracy_covered_rms: covered_spread.map(|s| s.rms),
            accuracy_covered_90: covered_spread.map(|s| s.p90),
            within_1_sigma: calibration.map(|c| c.within_1_sigma),
            within_2_sigma: calibration.map(|c| c.within_2_sigma),
            sigma_rank_correlation: calibration.map(|c| c.sigma_rank_correlation),
            error_bias: calibration.map(|c| c.error_bias),
            sigma_mean: calibration.map(|c| c.sigma_mean),
            calibration_vertices: calibration.map_or(0, |c| c.calibration_vertices),
            alignment_translation: MM * measured.pose.translation.vector.norm(),
            alignment_rotation: measured.pose.rotation.angle().to_degrees(),
            diagonal: MM * self.diagonal,
            raw: RawDistances(self.distances(raw)),
        }
    }
}

/// Refuses a mesh that cannot be measured.
fn check(mesh: &Mesh, which: &str) -> Result<()> {
    let count = mesh.vertices.len();
    if mesh.triangles.is_empty() {
        return Err(Error::input(format!("the {which} mesh has {count} vertices but no triangle")));
    }
    if let Some(i) = mesh.vertices.iter().position(|v| !v.iter().all(|c| c.is_finite())) {
        return Err(Error::input(format!("vertex {i} of the {which} mesh is not finite")));
    }
    let wrong = |t: &[u32; 3]| t.iter().any(|v| *v as usize >= count);
    if let Some(i) = mesh.triangles.iter().position(wrong) {
        return Err(Error::input(format!(
            "triangle {i} of the {which} mesh names vertices {:?}, but there are {count}",
            mesh.triangles[i]
        )));
    }
    Ok(())
}
