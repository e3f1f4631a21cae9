//! How good a filtered cloud is, on simulated scans.
//!
//! **Outliers** are the measurements that the simulator labels as outlier or flying and that lie farther than
//! [`FAR`] standard deviations of the sensor from the true surface; labelled ones that lie nearer are neither
//! outliers nor good. **Removed** are those that the filter says no point of its cloud explains.
//!
//! **The statistical limit** of a point is the standard deviation along the normal of the best linear unbiased estimate of
//! the surface there (generalised least squares; Aitken 1936) from all good measurements of its side within the
//! noise radius, the surface being a quadric. The estimate knows the true size of the sensor's noise by range and incidence,
//! its true correlation, and how far the arm wanders on a sweep in the mean of all profiles; its variance is that under
//! the true covariance. Nothing is added for outliers, robustness, edges or thinning. The **oracle**'s limit, in addition,
//! knows which profiles the arm's wander hits least, which no filter can.

use super::align::apply;
use super::distances::MM;
use super::reference::Reference;
use super::stats::{mean, rms, share};
use crate::filter::Filtered;
use crate::geometry::{Vec3, any_orthogonal};
use crate::mesh::Mesh;
use crate::simulate::{FLYING, GOOD, OUTLIER, SimulatedScans, TrueNoise};
use crate::voxel::CellIndex;
use crate::{Progress, Result};
use nalgebra::{DMatrix, SMatrix};
use rayon::prelude::*;
use serde::Serialize;

/// Standard deviations beyond which a labelled measurement is an outlier.
const FAR: f64 = 4.0;
/// Points of the cloud whose limit is taken: its mean square is then known to some per cent.
const LIMITED: usize = 2400;
/// Cosine between the normals of one side of a surface at least.
const ONE_SIDE: f64 = 0.7;

/// Figures of a filtered cloud. Lengths in mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FilterFigures {
    /// Measurements that went in.
    pub measurements: usize,
    /// True outliers among them.
    pub outliers: usize,
    /// Measurements removed, without labelled ones near the surface.
    pub removed: usize,
    /// Share of the removed that are outliers.
    pub precision: f64,
    /// Share of the outliers that are removed.
    pub recall: f64,
    /// Points of the cloud.
    pub kept: usize,
    /// Root mean square distance of the cloud to the truth.
    pub rms: f64,
    /// Statistical limit of it.
    pub limit: f64,
    /// The oracle's.
    pub limit_oracle: f64,
    /// Root mean square distance of those points whose limit was taken.
    pub rms_limited: f64,
    /// Share of the points at most one stated standard deviation off.
    pub within_1_sigma: f64,
    /// Share of the points at most two stated standard deviations off.
    pub within_2_sigma: f64,
    /// Root mean square stated standard deviation.
    pub sigma: f64,
    /// Mean signed distance, positive outside.
    pub bias: f64,
}

/// Measures what a filter made of all `scans` at their true poses against `truth` (metres, object frame).
///
/// # Errors
/// As [`Reference::new`]; [`crate::Error::Input`] if the result is of another number of scans; [`crate::Error::Cancelled`].
pub fn filter_figures(
    truth: &Mesh,
    scans: &SimulatedScans,
    filtered: &Filtered,
    progress: &Progress,
) -> Result<FilterFigures> {
    if filtered.refused.len() != scans.views.len() {
        return Err(crate::Error::input(format!(
            "the filter had {} scans, the simulation {}",
            filtered.refused.len(),
            scans.views.len()
        )));
    }
    progress.report("figures", 0.0)?;
    let reference = Reference::new(truth)?;
    let views: Vec<Vec<Truth>> =
        (0..scans.views.len()).map(|scan| truths(scans, scan, &reference)).collect();
    let counts = Counts::of(&views, filtered);
    progress.report("figures", 0.5)?;
    let cloud = &filtered.cloud;
    let nearest = reference.nearest_all(&cloud.points);
    let errors: Vec<f64> = nearest
        .iter()
        .zip(&cloud.points)
        .map(|(n, p)| n.distance.copysign((p - n.point).dot(&n.normal)))
        .collect();
    let ratios: Vec<f64> = errors.iter().zip(&cloud.sigma).map(|(e, s)| e.abs() / s).collect();
    let limits = Limits::new(views, filtered.noise_radius).of(filtered);
    let of = |f: fn(&Limit) -> f64| MM * rms(&limits.iter().map(f).collect::<Vec<f64>>());
    let limited: Vec<f64> = limits.iter().map(|l| errors[l.point]).collect();
    progress.report("figures", 1.0)?;
    Ok(FilterFigures {
        measurements: counts.all,
        outliers: counts.outliers,
        removed: counts.removed,
        precision: counts.found as f64 / counts.removed as f64,
        recall: counts.found as f64 / counts.outliers as f64,
        kept: cloud.len(),
        rms: MM * rms(&errors),
        limit: of(|l| l.usual),
        limit_oracle: of(|l| l.oracle),
        rms_limited: MM * rms(&limited),
        within_1_sigma: share(&ratios, |r| r <= 1.0),
        within_2_sigma: share(&ratios, |r| r <= 2.0),
        sigma: MM * rms(&cloud.sigma),
        bias: MM * mean(&errors),
    })
}

/// What is true of one measurement.
struct Truth {
    /// In the raw scan.
    index: usize,
    /// The noise-free hit, object frame, metres.
    hit: Vec3,
    /// Outward normal of the surface there.
    normal: Vec3,
    /// How far the noise moves the point along the normal per standard deviation, metres.
    sigma: f64,
    kind: Kind,
    noise: TrueNoise,
    scan: usize,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Good,
    Outlier,
    Neither,
}

/// Of the returns of one scan.
fn truths(scans: &SimulatedScans, scan: usize, reference: &Reference) -> Vec<Truth> {
    let view = &scans.views[scan];
    let noise = TrueNoise::new(scans.family, view.scan.width, view.scan.height());
    let of = |index: usize| -> Option<Truth> {
        let measured = view.scan.point(index)?;
        let in_sensor = Vec3::from(view.hits[index].map(f64::from));
        let ray = (measured - view.scan.origin(index)).try_normalize(0.0)?;
        let hit = apply(&view.true_pose, &in_sensor);
        let normal = reference.nearest(&hit).normal;
        let cosine = (view.true_pose.rotation * ray).dot(&normal).abs().max(1e-3);
        let sigma = noise.sigma(&in_sensor, &ray, cosine) * cosine;
        let kind = match view.labels[index] {
            OUTLIER | FLYING => {
                let distance = reference.nearest(&apply(&view.true_pose, &measured)).distance;
                let far = FAR * sigma.hypot(noise.wander(index, index).sqrt());
                if distance > far { Kind::Outlier } else { Kind::Neither }
            }
            GOOD => Kind::Good,
            _ => Kind::Neither,
        };
        Some(Truth { index, hit, normal, sigma, kind, noise, scan })
    };
    let returns: Vec<usize> = view.scan.returns().collect();
    returns.into_par_iter().filter_map(of).collect()
}

struct Counts {
    all: usize,
    outliers: usize,
    removed: usize,
    /// Outliers that were removed.
    found: usize,
}

impl Counts {
    fn of(views: &[Vec<Truth>], filtered: &Filtered) -> Counts {
        let mut counts = Counts { all: 0, outliers: 0, removed: 0, found: 0 };
        for (view, refused) in views.iter().zip(&filtered.refused) {
            for truth in view {
                let outlier = truth.kind == Kind::Outlier;
                let removed = truth.kind != Kind::Neither
                    && refused.binary_search(&(truth.index as u32)).is_ok();
                counts.all += 1;
                counts.outliers += usize::from(outlier);
                counts.removed += usize::from(removed);
                counts.found += usize::from(outlier && removed);
            }
        }
        counts
    }
}

/// The good measurements, by place.
struct Limits {
    good: Vec<Truth>,
    hits: Vec<Vec3>,
    cells: CellIndex,
    radius: f64,
}

/// Standard deviations along the normal of the best estimates at a point, metres.
struct Limit {
    point: usize,
    usual: f64,
    oracle: f64,
}

impl Limits {
    fn new(views: Vec<Vec<Truth>>, radius: f64) -> Limits {
        let good: Vec<Truth> =
            views.into_iter().flatten().filter(|t| t.kind == Kind::Good).collect();
        let hits: Vec<Vec3> = good.iter().map(|t| t.hit).collect();
        let cells = CellIndex::new(&hits, radius);
        Limits { good, hits, cells, radius }
    }

    fn of(&self, filtered: &Filtered) -> Vec<Limit> {
        let step = filtered.cloud.len().div_ceil(LIMITED).max(1);
        let some: Vec<usize> = (0..filtered.cloud.len()).step_by(step).collect();
        let limit = |&i: &usize| self.at(i, &filtered.cloud.points[i], &filtered.cloud.normals[i]);
        some.par_iter().filter_map(limit).collect()
    }

    /// `None` where no quadric is determined.
    fn at(&self, index: usize, point: &Vec3, normal: &Vec3) -> Option<Limit> {
        let mut near: Vec<&Truth> = Vec::new();
        self.cells.for_each_within(&self.hits, point, self.radius, |i, _| {
            if self.good[i].normal.dot(normal) >= ONE_SIDE {
                near.push(&self.good[i]);
            }
        });
        near.sort_by_key(|t| (t.scan, t.index));
        let (u, v) = (any_orthogonal(normal), normal.cross(&any_orthogonal(normal)));
        let row = |t: &Truth| {
            let offset = (t.hit - point) / self.radius;
            let (a, b) = (offset.dot(&u), offset.dot(&v));
            [1.0, a, b, a * a, a * b, b * b]
        };
        let mut known = Information::default();
        let mut usual = Information::default();
        for scan in near.chunk_by(|a, b| a.scan == b.scan) {
            let design = DMatrix::from_fn(scan.len(), TERMS, |i, j| row(scan[i])[j]);
            let truth = covariance(scan, |a, b| a.noise.wander(a.index, b.index));
            known.add(&design, &truth, &truth)?;
            usual.add(&design, &covariance(scan, |a, _| a.noise.usual_wander()), &truth)?;
        }
        // A border may leave the quadric open.
        Some(Limit { point: index, usual: usual.deviation()?, oracle: known.deviation()? })
    }
}

const TERMS: usize = 6;

/// What measurements say of a quadric's terms, weighted by one covariance, and how that varies under another.
#[derive(Default)]
struct Information {
    matrix: SMatrix<f64, TERMS, TERMS>,
    variance: SMatrix<f64, TERMS, TERMS>,
}

impl Information {
    /// Adds one scan; `None` if `believed` is no covariance.
    fn add(
        &mut self,
        design: &DMatrix<f64>,
        believed: &DMatrix<f64>,
        truth: &DMatrix<f64>,
    ) -> Option<()> {
        let weighted = believed.clone().cholesky()?.solve(design);
        self.matrix += design.transpose() * &weighted;
        self.variance += weighted.transpose() * truth * &weighted;
        Some(())
    }

    /// Standard deviation of the height at the origin, metres; `None` if it is not determined. Curvature is believed
    /// zero as much as one measurement in a hundred says, as any filter must at a border.
    fn deviation(&self) -> Option<f64> {
        let mut matrix = self.matrix;
        for i in 1..TERMS {
            matrix[(i, i)] += matrix[(0, 0)] * 1e-2;
        }
        let inverse = matrix.cholesky()?.inverse();
        Some((inverse * self.variance * inverse)[(0, 0)].sqrt())
    }
}

/// Covariance of measurements of one scan along the normal, square metres; `wander` is its part by the arm per axis.
fn covariance(scan: &[&Truth], wander: impl Fn(&Truth, &Truth) -> f64) -> DMatrix<f64> {
    DMatrix::from_fn(scan.len(), scan.len(), |i, j| {
        let (a, b) = (scan[i], scan[j]);
        let along = a.sigma * b.sigma * a.noise.correlation(a.index, b.index);
        along + a.normal.dot(&b.normal) * wander(a, b)
    })
}

#[cfg(test)]
#[path = "filtering_tests.rs"]
mod tests;
