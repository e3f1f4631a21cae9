//! Figures from the distances between two surfaces, in mm.

use super::reference::Nearest;
use super::sample::Sample;
use super::stats::{mean, quantile, rms, share};
use crate::geometry::Pose;
use serde::ser::{Serialize, SerializeMap, Serializer};

/// Metres to millimetres.
pub(crate) const MM: f64 = 1000.0;

/// How far two surfaces are from each other, after one alignment; lengths in mm.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Distances {
    /// Result to truth, mean.
    pub accuracy_mean: f64,
    /// Result to truth, root mean square.
    pub accuracy_rms: f64,
    /// Result to truth, 90 % are nearer.
    pub accuracy_90: f64,
    /// Truth to result, mean.
    pub completeness_mean: f64,
    /// Truth to result, root mean square.
    pub completeness_rms: f64,
    /// Truth to result, 90 % are nearer.
    pub completeness_90: f64,
    /// Half the sum of the two means.
    pub chamfer: f64,
    /// The largest distance of all samples, both ways.
    pub hausdorff: f64,
    /// Harmonic mean of the shares nearer than 1 mm, both ways.
    pub f_1mm: f64,
    /// Harmonic mean of the shares nearer than 0.5 % of the truth's diagonal, both ways.
    pub f_half_percent: f64,
    /// Mean size of the cosine between the normals of a sample and of its nearest point, both ways
    /// (Mescheder et al. 2019, Occupancy Networks, supplementary §3); blind to orientation.
    pub normal_consistency: f64,
}

/// Samples of one surface and the points of the other that are nearest to them.
pub(crate) struct OneWay<'a> {
    pub(crate) samples: &'a [Sample],
    pub(crate) nearest: &'a [Nearest],
    /// Turns the samples' normals into the frame of the nearest points' normals.
    pub(crate) pose: &'a Pose,
}

impl OneWay<'_> {
    pub(crate) fn distances(&self) -> Vec<f64> {
        self.nearest.iter().map(|n| n.distance).collect()
    }

    fn cosines(&self) -> Vec<f64> {
        let cosine =
            |(s, n): (&Sample, &Nearest)| (self.pose.rotation * s.normal).dot(&n.normal).abs();
        self.samples.iter().zip(self.nearest).map(cosine).collect()
    }
}

impl Distances {
    pub(crate) fn of(there: &OneWay, back: &OneWay, diagonal: f64) -> Distances {
        let (accuracy, completeness) = (there.distances(), back.distances());
        let largest = accuracy.iter().chain(&completeness).fold(0.0f64, |a, b| a.max(*b));
        Distances {
            accuracy_mean: MM * mean(&accuracy),
            accuracy_rms: MM * rms(&accuracy),
            accuracy_90: MM * quantile(&accuracy, 0.9),
            completeness_mean: MM * mean(&completeness),
            completeness_rms: MM * rms(&completeness),
            completeness_90: MM * quantile(&completeness, 0.9),
            chamfer: MM * (mean(&accuracy) + mean(&completeness)) / 2.0,
            hausdorff: MM * largest,
            f_1mm: f_score(&accuracy, &completeness, 0.001),
            f_half_percent: f_score(&accuracy, &completeness, 0.005 * diagonal),
            normal_consistency: (mean(&there.cosines()) + mean(&back.cosines())) / 2.0,
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

/// Knapitsch et al. 2017, Tanks and Temples, eq. (5).
fn f_score(accuracy: &[f64], completeness: &[f64], threshold: f64) -> f64 {
    let precision = share(accuracy, |d| d < threshold);
    let recall = share(completeness, |d| d < threshold);
    if precision + recall > 0.0 { 2.0 * precision * recall / (precision + recall) } else { 0.0 }
}

/// Mean, root mean square and 90 % of distances, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// Root mean square.
    pub rms: f64,
    /// 90 % are smaller.
    pub p90: f64,
}

impl Spread {
    /// Of distances in metres; `None` of nothing.
    pub(crate) fn of(distances: &[f64]) -> Option<Spread> {
        (!distances.is_empty()).then(|| Spread {
            mean: MM * mean(distances),
            rms: MM * rms(distances),
            p90: MM * quantile(distances, 0.9),
        })
    }
}
