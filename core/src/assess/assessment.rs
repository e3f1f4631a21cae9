//! Every figure of a mesh against the truth.

use super::calibration::{SigmaCalibration, assess_sigma};
use super::distances::{DirectedDistances, DistanceSummary, Distances, MM_PER_M, RawDistances};
use super::params::AssessParams;
use super::reference_surface::{NearestPoint, ReferenceSurface, interior_distances};
use super::statistics::{quantile, rms, share};
use super::surface_icp::align_to_surface;
use super::surface_samples::{SurfaceSample, sample_surface};
use super::topology::{Topology, assess_topology};
use crate::geometry::{KdTree, MAD_TO_SIGMA, Pose, Vec3, transform};
use crate::mesh::{Mesh, invariants};
use crate::{Error, Progress, Result};
use serde::Serialize;

/// An alignment that makes the root mean square distance larger by this factor has failed.
/// Minimising the distances along the normals may cost a little in the whole distance.
const MAX_RMS_GROWTH_FACTOR: f64 = 1.1;
/// A spread below this share of the diagonal is rounding, not noise.
const MIN_SIGMA_RATIO: f64 = 1e-6;
/// Samples of the result farther from the truth than this many sigma form a double surface.
const MAX_SURFACE_SIGMAS: f64 = 3.0;
/// Samples of the truth farther from the result than this are in a hole.
const MIN_HOLE_DISTANCE_M: f64 = 0.002;
/// A sample counts as seen if a seen point is nearer than this many spacings of the samples.
const SEEN_RADIUS_SPACINGS: f64 = 2.0;

/// Every figure of a mesh against the truth. Lengths in mm, angles in degrees; `None` and NaN
/// become null in JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Assessment {
    /// Validity of the mesh and shape of its triangles.
    #[serde(flatten)]
    pub topology: Topology,
    /// Mean distance of the result's samples to the truth after the alignment (cRMS of the thesis).
    pub crms_mean: f64,
    /// Root mean square of the same distances.
    pub crms_rms: f64,
    /// Samples that the alignment uses: those whose nearest point of the truth is not on its
    /// boundary.
    pub correspondences: usize,
    /// All distances after the alignment.
    #[serde(flatten)]
    pub aligned: Distances,
    /// Share of the result that is farther than 3 sigma from the truth, inside or outside.
    pub double_surface: f64,
    /// The sigma that `double_surface` uses.
    pub double_surface_sigma: f64,
    /// Share of the truth that is farther than 2 mm from the result.
    pub holes: f64,
    /// Share of the truth that the scans saw.
    pub seen_share: Option<f64>,
    /// Mean distance to the result of the part of the truth that the scans saw.
    pub completeness_seen_mean: Option<f64>,
    /// Root mean square of the same distances.
    pub completeness_seen_rms: Option<f64>,
    /// The value below which 90 % of the same distances lie.
    pub completeness_seen_90: Option<f64>,
    /// Share of the part that the scans saw that is farther than 2 mm from the result.
    pub holes_seen: Option<f64>,
    /// If the truth is open: share of the result's samples whose nearest point of the truth is not
    /// on the truth's boundary.
    pub covered_share: Option<f64>,
    /// If the truth is open: mean distance of these samples to the truth.
    pub accuracy_covered_mean: Option<f64>,
    /// Root mean square of the same distances.
    pub accuracy_covered_rms: Option<f64>,
    /// The value below which 90 % of the same distances lie.
    pub accuracy_covered_90: Option<f64>,
    /// Share of the observed vertices whose error is at most sigma.
    pub within_1_sigma: Option<f64>,
    /// Share of the observed vertices whose error is at most 2 sigma.
    pub within_2_sigma: Option<f64>,
    /// Spearman's rank correlation of sigma and the size of the error.
    pub sigma_rank_correlation: Option<f64>,
    /// Mean signed error of the observed vertices, positive outside.
    pub error_bias: Option<f64>,
    /// Mean sigma of the observed vertices.
    pub sigma_mean: Option<f64>,
    /// Number of observed vertices with a sigma.
    pub calibration_vertices: usize,
    /// Length of the alignment's translation.
    pub alignment_translation: f64,
    /// Angle of the alignment's rotation.
    pub alignment_rotation: f64,
    /// Diagonal of the truth's bounding box.
    pub diagonal: f64,
    /// All distances before the alignment.
    #[serde(flatten)]
    pub raw: RawDistances,
}

/// Measures `result` against `truth`, both in metres and in the same frame.
///
/// The alignment is dropped if it makes the root mean square distance a tenth larger, because the
/// ICP has diverged then.
///
/// # Errors
/// [`Error::Input`] if a mesh has no area, a coordinate that is not finite or an index out of
/// range, or if no sample is asked for; [`Error::Cancelled`].
pub fn assess(
    result: &Mesh,
    truth: &Mesh,
    params: &AssessParams,
    progress: &Progress,
) -> Result<Assessment> {
    check_measurable(result, "result")?;
    check_measurable(truth, "truth")?;
    if params.samples == 0 {
        return Err(Error::input("0 samples measure nothing: ask for 1 or more (100000 is usual)"));
    }
    progress.report("assess", 0.0)?;
    let pair = SurfacePair::new(result, truth, params)?;
    let raw = pair.measure(&Pose::identity());
    progress.report("assess", 0.2)?;
    let points: Vec<Vec3> = pair.result_samples.iter().map(|s| s.point).collect();
    let pose = align_to_surface(&points, &pair.truth, progress)?.pose;
    progress.report("assess", 0.5)?;
    let mut aligned = pair.measure(&pose);
    if rms(&aligned.accuracy()) > MAX_RMS_GROWTH_FACTOR * rms(&raw.accuracy()) {
        aligned = pair.measure(&Pose::identity());
    }
    progress.report("assess", 0.7)?;
    let topology = assess_topology(result);
    progress.report("assess", 0.8)?;
    let calibration = assess_sigma(result, &pair.truth, progress)?;
    progress.report("assess", 1.0)?;
    Ok(pair.assessment(params, topology, &raw, &aligned, calibration))
}

/// The two surfaces with their samples.
struct SurfacePair {
    result: ReferenceSurface,
    truth: ReferenceSurface,
    result_samples: Vec<SurfaceSample>,
    truth_samples: Vec<SurfaceSample>,
    diagonal: f64,
    truth_area: f64,
    truth_is_open: bool,
}

/// The nearest points both ways under one pose.
struct Correspondences {
    /// `truth_from_result`.
    pose: Pose,
    /// Nearest points of the truth to the result's samples.
    on_truth: Vec<NearestPoint>,
    /// Nearest points of the result to the truth's samples.
    on_result: Vec<NearestPoint>,
}

impl Correspondences {
    /// Distances of the result's samples to the truth, metres.
    fn accuracy(&self) -> Vec<f64> {
        self.on_truth.iter().map(|n| n.distance).collect()
    }

    /// Distances of the truth's samples to the result, metres.
    fn completeness(&self) -> Vec<f64> {
        self.on_result.iter().map(|n| n.distance).collect()
    }
}

impl SurfacePair {
    fn new(result: &Mesh, truth: &Mesh, params: &AssessParams) -> Result<SurfacePair> {
        Ok(SurfacePair {
            result: ReferenceSurface::new(result)?,
            truth: ReferenceSurface::new(truth)?,
            result_samples: sample_surface(result, params.samples, params.seed, 0)?,
            truth_samples: sample_surface(truth, params.samples, params.seed, 1)?,
            diagonal: truth.aabb().diagonal(),
            truth_area: truth.area(),
            truth_is_open: !invariants::is_closed(truth),
        })
    }

    /// Finds the nearest points with the result moved by `truth_from_result`. The surface of the
    /// result itself is not moved; the truth's samples are moved by the inverse instead.
    fn measure(&self, truth_from_result: &Pose) -> Correspondences {
        let result_points = move_samples(&self.result_samples, truth_from_result);
        let truth_points = move_samples(&self.truth_samples, &truth_from_result.inverse());
        Correspondences {
            pose: *truth_from_result,
            on_truth: self.truth.nearest_all(&result_points),
            on_result: self.result.nearest_all(&truth_points),
        }
    }

    fn distances(&self, measured: &Correspondences) -> Distances {
        let result_from_truth = measured.pose.inverse();
        let to_truth = DirectedDistances {
            samples: &self.result_samples,
            nearest: &measured.on_truth,
            pose: &measured.pose,
        };
        let to_result = DirectedDistances {
            samples: &self.truth_samples,
            nearest: &measured.on_result,
            pose: &result_from_truth,
        };
        Distances::new(&to_truth, &to_result, self.diagonal)
    }

    /// Distances to the result of the truth's samples that lie near a seen point, metres.
    fn distances_of_seen(&self, measured: &Correspondences, seen: &[Vec3]) -> Vec<f64> {
        let spacing = (self.truth_area / self.truth_samples.len() as f64).sqrt();
        let tree = KdTree::new(seen);
        let radius = SEEN_RADIUS_SPACINGS * spacing;
        let pairs = self.truth_samples.iter().zip(&measured.on_result);
        pairs
            .filter(|(s, _)| tree.nearest_within(&s.point, radius).is_some())
            .map(|(_, n)| n.distance)
            .collect()
    }

    fn assessment(
        &self,
        params: &AssessParams,
        topology: Topology,
        raw: &Correspondences,
        measured: &Correspondences,
        calibration: Option<SigmaCalibration>,
    ) -> Assessment {
        let aligned = self.distances(measured);
        let accuracy = measured.accuracy();
        let min_sigma = MIN_SIGMA_RATIO * self.diagonal;
        let median = quantile(&accuracy, 0.5);
        let sigma = params.noise_sigma.unwrap_or(MAD_TO_SIGMA * median).max(min_sigma);
        let seen = params.seen.as_ref().map(|seen| self.distances_of_seen(measured, seen));
        let seen_summary = seen.as_deref().and_then(DistanceSummary::from_metres);
        let covered = self.truth_is_open.then(|| interior_distances(&measured.on_truth));
        let covered_summary = covered.as_deref().and_then(DistanceSummary::from_metres);
        let samples = params.samples as f64;
        Assessment {
            topology,
            crms_mean: aligned.accuracy_mean,
            crms_rms: aligned.accuracy_rms,
            correspondences: measured.on_truth.iter().filter(|n| !n.on_boundary).count(),
            aligned,
            double_surface: share(&accuracy, |d| d > MAX_SURFACE_SIGMAS * sigma),
            double_surface_sigma: MM_PER_M * sigma,
            holes: hole_share(&measured.completeness()),
            seen_share: seen.as_ref().map(|d| d.len() as f64 / samples),
            completeness_seen_mean: seen_summary.map(|s| s.mean),
            completeness_seen_rms: seen_summary.map(|s| s.rms),
            completeness_seen_90: seen_summary.map(|s| s.p90),
            holes_seen: seen.as_deref().filter(|s| !s.is_empty()).map(hole_share),
            covered_share: covered.as_ref().map(|d| d.len() as f64 / samples),
            accuracy_covered_mean: covered_summary.map(|s| s.mean),
            accuracy_covered_rms: covered_summary.map(|s| s.rms),
            accuracy_covered_90: covered_summary.map(|s| s.p90),
            within_1_sigma: calibration.map(|c| c.within_1_sigma),
            within_2_sigma: calibration.map(|c| c.within_2_sigma),
            sigma_rank_correlation: calibration.map(|c| c.sigma_rank_correlation),
            error_bias: calibration.map(|c| c.error_bias),
            sigma_mean: calibration.map(|c| c.sigma_mean),
            calibration_vertices: calibration.map_or(0, |c| c.calibration_vertices),
            alignment_translation: MM_PER_M * measured.pose.translation.vector.norm(),
            alignment_rotation: measured.pose.rotation.angle().to_degrees(),
            diagonal: MM_PER_M * self.diagonal,
            raw: RawDistances(self.distances(raw)),
        }
    }
}

/// The samples' points moved by `pose`.
fn move_samples(samples: &[SurfaceSample], pose: &Pose) -> Vec<Vec3> {
    samples.iter().map(|s| transform(pose, &s.point)).collect()
}

/// Share of the distances (metres) that are in a hole.
fn hole_share(distances: &[f64]) -> f64 {
    share(distances, |d| d > MIN_HOLE_DISTANCE_M)
}

/// Returns an error for a mesh that cannot be measured.
fn check_measurable(mesh: &Mesh, which: &str) -> Result<()> {
    let count = mesh.vertices.len();
    if mesh.triangles.is_empty() {
        return Err(Error::input(format!("the {which} mesh has {count} vertices but no triangle")));
    }
    if let Some(i) = mesh.vertices.iter().position(|v| !v.iter().all(|c| c.is_finite())) {
        return Err(Error::input(format!("vertex {i} of the {which} mesh is not finite")));
    }
    let out_of_range = mesh.triangles.iter().position(|t| t.iter().any(|v| *v as usize >= count));
    if let Some(i) = out_of_range {
        return Err(Error::input(format!(
            "triangle {i} of the {which} mesh names vertices {:?}, but there are {count}",
            mesh.triangles[i]
        )));
    }
    Ok(())
}

#[cfg(test)]
#[path = "assessment_tests.rs"]
mod tests;
