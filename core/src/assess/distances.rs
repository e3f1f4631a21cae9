//! Figures from the distances between two surfaces, mm.

use super::reference_surface::NearestPoint;
use super::statistics::{mean, quantile, rms, share};
use super::surface_samples::SurfaceSample;
use crate::geometry::Pose;
use serde::ser::{Serialize, SerializeMap, Serializer};

/// Millimetres in a metre: figures are in mm, meshes in metres.
pub(crate) const MM_PER_M: f64 = 1000.0;
/// Distance below which a sample counts as covered in `f_1mm`, metres.
const F_SCORE_DISTANCE_M: f64 = 0.001;
/// Distance below which a sample counts as covered in `f_half_percent`, as a share of the diagonal.
const F_SCORE_DIAGONAL_RATIO: f64 = 0.005;
/// The order statistic of the figures named `..._90`.
const UPPER_QUANTILE: f64 = 0.9;

/// Distances between a result and the truth under one alignment; lengths in mm.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Distances {
    /// Mean distance of the result's samples to the truth.
    pub accuracy_mean: f64,
    /// Root mean square distance of the result's samples to the truth.
    pub accuracy_rms: f64,
    /// The distance below which 90 % of the result's samples are from the truth.
    pub accuracy_90: f64,
    /// Mean distance of the truth's samples to the result.
    pub completeness_mean: f64,
    /// Root mean square distance of the truth's samples to the result.
    pub completeness_rms: f64,
    /// The distance below which 90 % of the truth's samples are from the result.
    pub completeness_90: f64,
    /// Chamfer distance: half the sum of the two means.
    pub chamfer: f64,
    /// Hausdorff distance of the samples: the largest distance, both ways.
    pub hausdorff: f64,
    /// F-score: harmonic mean of the shares of both surfaces' samples that are nearer than 1 mm.
    pub f_1mm: f64,
    /// F-score at 0.5 % of the diagonal of the truth's bounding box.
    pub f_half_percent: f64,
    /// Mean absolute cosine between the normals of a sample and of its nearest point, both ways
    /// (Mescheder et al. 2019, Occupancy Networks, supplementary §3). The orientation does not
    /// count.
    pub normal_consistency: f64,
}

/// Samples of one surface and the points of the other that are nearest to them.
pub(crate) struct DirectedDistances<'a> {
    pub(crate) samples: &'a [SurfaceSample],
    pub(crate) nearest: &'a [NearestPoint],
    /// Rotates the samples' normals into the frame of the nearest points' normals.
    pub(crate) pose: &'a Pose,
}

impl DirectedDistances<'_> {
    pub(crate) fn distances(&self) -> Vec<f64> {
        self.nearest.iter().map(|n| n.distance).collect()
    }

    /// Absolute cosines between the normals of the samples and of their nearest points.
    fn normal_cosines(&self) -> Vec<f64> {
        let pairs = self.samples.iter().zip(self.nearest);
        pairs.map(|(s, n)| (self.pose.rotation * s.normal).dot(&n.normal).abs()).collect()
    }
}

impl Distances {
    /// Figures of the distances from the result to the truth and from the truth to the result;
    /// `diagonal` is that of the truth's bounding box, metres.
    pub(crate) fn new(
        to_truth: &DirectedDistances,
        to_result: &DirectedDistances,
        diagonal: f64,
    ) -> Distances {
        let (accuracy, completeness) = (to_truth.distances(), to_result.distances());
        let largest = accuracy.iter().chain(&completeness).fold(0.0f64, |a, b| a.max(*b));
        Distances {
            accuracy_mean: MM_PER_M * mean(&accuracy),
            accuracy_rms: MM_PER_M * rms(&accuracy),
            accuracy_90: MM_PER_M * quantile(&accuracy, UPPER_QUANTILE),
            completeness_mean: MM_PER_M * mean(&completeness),
            completeness_rms: MM_PER_M * rms(&completeness),
            completeness_90: MM_PER_M * quantile(&completeness, UPPER_QUANTILE),
            chamfer: MM_PER_M * (mean(&accuracy) + mean(&completeness)) / 2.0,
            hausdorff: MM_PER_M * largest,
            f_1mm: f_score(&accuracy, &completeness, F_SCORE_DISTANCE_M),
            f_half_percent: f_score(&accuracy, &completeness, F_SCORE_DIAGONAL_RATIO * diagonal),
            normal_consistency: (mean(&to_truth.normal_cosines())
                + mean(&to_result.normal_cosines()))
                / 2.0,
        }
    }

    fn entries(&self) -> [(&'static str, f64); 11] {
        [
            ("raw_accuracy_mean", self.accuracy_mean),
            ("raw_accuracy_rms", self.accuracy_rms),
            ("raw_accuracy_90", self.accuracy_90),
            ("raw_completeness_mean", self.completeness_mean),
            ("raw_completeness_rms", self.completeness_rms),
            ("raw_completeness_90", self.completeness_90),
            ("raw_chamfer", self.chamfer),
            ("raw_hausdorff", self.hausdorff),
            ("raw_f_1mm", self.f_1mm),
            ("raw_f_half_percent", self.f_half_percent),
            ("raw_normal_consistency", self.normal_consistency),
        ]
    }
}

/// [`Distances`] before any alignment; its keys begin with `raw_`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RawDistances(pub Distances);

impl Serialize for RawDistances {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let entries = self.0.entries();
        let mut map = serializer.serialize_map(Some(entries.len()))?;
        for (key, value) in entries {
            map.serialize_entry(key, &value)?;
        }
        map.end()
    }
}

/// F-score at `threshold` (metres) (Knapitsch et al. 2017, Tanks and Temples, eq. (5)).
fn f_score(accuracy: &[f64], completeness: &[f64], threshold: f64) -> f64 {
    let precision = share(accuracy, |d| d < threshold);
    let recall = share(completeness, |d| d < threshold);
    // (5) of Knapitsch et al.
    if precision + recall > 0.0 { 2.0 * precision * recall / (precision + recall) } else { 0.0 }
}

/// Mean, root mean square and 90 % quantile of distances, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistanceSummary {
    /// Mean.
    pub mean: f64,
    /// Root mean square.
    pub rms: f64,
    /// The value below which 90 % of the distances lie.
    pub p90: f64,
}

impl DistanceSummary {
    /// Summarises distances in metres; `None` if there are none.
    pub(crate) fn from_metres(distances: &[f64]) -> Option<DistanceSummary> {
        (!distances.is_empty()).then(|| DistanceSummary {
            mean: MM_PER_M * mean(distances),
            rms: MM_PER_M * rms(distances),
            p90: MM_PER_M * quantile(distances, UPPER_QUANTILE),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vec3;

    #[test]
    fn the_f_score_is_the_harmonic_mean_of_precision_and_recall() {
        // Precision 3/4, recall 1/2.
        let score = f_score(&[0.0, 1.0, 1.0, 9.0], &[1.0, 9.0], 2.0);
        assert!((score - 2.0 * 0.75 * 0.5 / 1.25).abs() < 1e-15);
        assert_eq!(f_score(&[9.0], &[9.0], 2.0), 0.0);
        assert_eq!(f_score(&[2.0], &[1.0], 2.0), 0.0, "the threshold itself is too far");
    }

    #[test]
    fn a_summary_is_in_millimetres() {
        let summary = DistanceSummary::from_metres(&[0.001, 0.002, 0.003]).unwrap();
        assert!((summary.mean - 2.0).abs() < 1e-12);
        assert!((summary.rms - (14.0f64 / 3.0).sqrt()).abs() < 1e-12);
        assert!((summary.p90 - 2.8).abs() < 1e-12);
        assert_eq!(DistanceSummary::from_metres(&[]), None);
    }

    /// Distances of points on a plane to a parallel plane that is `offset` metres away.
    fn parallel_planes(offset: f64) -> Distances {
        let samples = [SurfaceSample { point: Vec3::zeros(), normal: Vec3::z() }];
        let nearest = [NearestPoint {
            point: Vec3::z() * offset,
            distance: offset,
            normal: -Vec3::z(),
            on_boundary: false,
        }];
        let pose = Pose::identity();
        let one_way = DirectedDistances { samples: &samples, nearest: &nearest, pose: &pose };
        Distances::new(&one_way, &one_way, 1.0)
    }

    #[test]
    fn parallel_planes_are_as_far_apart_as_they_are() {
        let figures = parallel_planes(0.002);
        for length in [
            figures.accuracy_mean,
            figures.accuracy_rms,
            figures.accuracy_90,
            figures.completeness_mean,
            figures.completeness_rms,
            figures.completeness_90,
            figures.chamfer,
            figures.hausdorff,
        ] {
            assert!((length - 2.0).abs() < 1e-12);
        }
        assert_eq!((figures.f_1mm, figures.f_half_percent), (0.0, 1.0));
        assert_eq!(figures.normal_consistency, 1.0, "the orientation does not count");
    }

    #[test]
    fn raw_keys_are_those_of_the_aligned_figures_with_a_prefix() {
        let figures = parallel_planes(0.001);
        let aligned = serde_json::to_value(figures).unwrap();
        let raw = serde_json::to_value(RawDistances(figures)).unwrap();
        let (aligned, raw) = (aligned.as_object().unwrap(), raw.as_object().unwrap());
        assert_eq!(aligned.len(), raw.len());
        for (key, value) in aligned {
            assert_eq!(&raw[&format!("raw_{key}")], value);
        }
    }
}
