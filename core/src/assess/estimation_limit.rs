//! The statistical limit of a filtered cloud's error.
//!
//! The limit of a point is the standard deviation along the normal of the best linear unbiased
//! estimate (generalised least squares; Aitken 1936) of the surface there, from all good
//! measurements of its side within the noise radius, where the surface is a quadric. The estimate
//! knows the true size of the sensor's noise by range and incidence, its true correlation, and how
//! far the arm wanders on a sweep in the mean of all profiles; its variance is that under the true
//! covariance. Nothing is added for outliers, robustness, edges or thinning.
//!
//! The limit of the oracle knows in addition which profiles the arm's wander affects least, which
//! no filter can know.

use super::true_measurement::{MeasurementClass, TrueMeasurement};
use crate::filter::Filtered;
use crate::geometry::{Vec3, any_orthogonal};
use crate::voxel::CellIndex;
use nalgebra::{DMatrix, SMatrix};
use rayon::prelude::*;

/// Upper limit of the points of the cloud whose limit is computed: their mean square is known to a
/// few per cent.
const MAX_LIMIT_POINTS: usize = 2400;
/// Measurements belong to one side of a surface if the cosine between their normals is at least
/// this.
const MIN_SAME_SIDE_COS: f64 = 0.7;
/// Terms of a quadric height field: 1, a, b, a^2, a b, b^2.
const QUADRIC_TERMS: usize = 6;
/// Slopes and curvatures are believed to be zero with this share of the information on the height,
/// as any filter must at a border.
const PRIOR_INFORMATION_RATIO: f64 = 1e-2;

/// Computes limits from the good measurements near each point.
pub(super) struct LimitEstimator {
    good: Vec<TrueMeasurement>,
    hits: Vec<Vec3>,
    cells: CellIndex,
    /// Noise radius, metres.
    radius: f64,
}

/// Standard deviations along the normal of the best estimates at a point, metres.
pub(super) struct ErrorLimit {
    /// Index of the point in the cloud.
    pub point: usize,
    /// Limit of an estimate that knows the arm's wander in the mean of all profiles.
    pub usual: f64,
    /// Limit of an estimate that knows the arm's wander of each profile.
    pub oracle: f64,
}

impl LimitEstimator {
    /// Takes the measurements of all scans; `radius` is the noise radius, metres.
    pub(super) fn new(views: Vec<Vec<TrueMeasurement>>, radius: f64) -> LimitEstimator {
        let good: Vec<TrueMeasurement> =
            views.into_iter().flatten().filter(|t| t.class == MeasurementClass::Good).collect();
        let hits: Vec<Vec3> = good.iter().map(|t| t.hit).collect();
        let cells = CellIndex::new(&hits, radius);
        LimitEstimator { good, hits, cells, radius }
    }

    /// The limits of a subsample of the points of the cloud.
    pub(super) fn estimate(&self, filtered: &Filtered) -> Vec<ErrorLimit> {
        let step = filtered.cloud.len().div_ceil(MAX_LIMIT_POINTS).max(1);
        let points: Vec<usize> = (0..filtered.cloud.len()).step_by(step).collect();
        let (positions, normals) = (&filtered.cloud.points, &filtered.cloud.normals);
        points.par_iter().filter_map(|&i| self.limit_at(i, &positions[i], &normals[i])).collect()
    }

    /// The limit at a point of the cloud; `None` where the measurements do not determine a quadric.
    pub(super) fn limit_at(&self, index: usize, point: &Vec3, normal: &Vec3) -> Option<ErrorLimit> {
        let mut near: Vec<&TrueMeasurement> = Vec::new();
        self.cells.for_each_within(&self.hits, point, self.radius, |i, _| {
            if self.good[i].normal.dot(normal) >= MIN_SAME_SIDE_COS {
                near.push(&self.good[i]);
            }
        });
        near.sort_by_key(|t| (t.scan, t.index));
        let (u, v) = (any_orthogonal(normal), normal.cross(&any_orthogonal(normal)));
        let mut oracle = QuadricInformation::default();
        let mut usual = QuadricInformation::default();
        for scan in near.chunk_by(|a, b| a.scan == b.scan) {
            let design = DMatrix::from_fn(scan.len(), QUADRIC_TERMS, |i, j| {
                let offset = (scan[i].hit - point) / self.radius;
                quadric_terms(offset.dot(&u), offset.dot(&v))[j]
            });
            let truth = covariance(scan, |a, b| a.noise.walk_covariance(a.index, b.index));
            oracle.add(&design, &truth, &truth)?;
            usual.add(&design, &covariance(scan, |a, _| a.noise.mean_walk_variance()), &truth)?;
        }
        // At a border the measurements may leave the quadric undetermined.
        Some(ErrorLimit { point: index, usual: usual.deviation()?, oracle: oracle.deviation()? })
    }
}

/// The terms of a quadric height field at (a, b).
fn quadric_terms(a: f64, b: f64) -> [f64; QUADRIC_TERMS] {
    [1.0, a, b, a * a, a * b, b * b]
}

/// Information of measurements on a quadric's terms, weighted by a believed covariance, and its
/// variance under the true covariance.
#[derive(Default)]
struct QuadricInformation {
    matrix: SMatrix<f64, QUADRIC_TERMS, QUADRIC_TERMS>,
    variance: SMatrix<f64, QUADRIC_TERMS, QUADRIC_TERMS>,
}

impl QuadricInformation {
    /// Adds the measurements of one scan; `None` if `believed` is not positive definite.
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

    /// Standard deviation of the height at the origin, metres; `None` if it is not determined.
    fn deviation(&self) -> Option<f64> {
        let mut matrix = self.matrix;
        for i in 1..QUADRIC_TERMS {
            matrix[(i, i)] += matrix[(0, 0)] * PRIOR_INFORMATION_RATIO;
        }
        let inverse = matrix.cholesky()?.inverse();
        Some((inverse * self.variance * inverse)[(0, 0)].sqrt())
    }
}

/// Covariance of the measurements of one scan along the normal, square metres; `wander` gives the
/// covariance per axis that the arm's wander causes between two of them.
fn covariance(
    scan: &[&TrueMeasurement],
    wander: impl Fn(&TrueMeasurement, &TrueMeasurement) -> f64,
) -> DMatrix<f64> {
    DMatrix::from_fn(scan.len(), scan.len(), |i, j| {
        let (a, b) = (scan[i], scan[j]);
        let along = a.sigma * b.sigma * a.noise.correlation(a.index, b.index);
        along + a.normal.dot(&b.normal) * wander(a, b)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{NoiseFamily, TrueNoise};

    /// White noise of `sigma` (metres) on a grid in the plane z = 0, each point in a scan of its
    /// own.
    fn plane(sigma: f64, steps: usize) -> Vec<TrueMeasurement> {
        let noise = TrueNoise::new(NoiseFamily::P1, 100, 1);
        let points = (0..steps * steps).map(|i| {
            let (x, y) = ((i % steps) as f64, (i / steps) as f64);
            let middle = (steps - 1) as f64 / 2.0;
            TrueMeasurement {
                index: 0,
                hit: Vec3::new(x - middle, y - middle, 0.0) * 1e-3 / steps as f64,
                normal: Vec3::z(),
                sigma,
                class: MeasurementClass::Good,
                noise,
                scan: i,
            }
        });
        points.collect()
    }

    fn limit(measurements: Vec<TrueMeasurement>) -> Option<f64> {
        let estimator = LimitEstimator::new(vec![measurements], 1e-3);
        estimator.limit_at(0, &Vec3::zeros(), &Vec3::z()).map(|limit| limit.usual)
    }

    #[test]
    fn the_limit_grows_with_sigma_and_shrinks_with_the_root_of_the_count() {
        let reference = limit(plane(1e-3, 10)).unwrap();
        let noisy = limit(plane(2e-3, 10)).unwrap();
        assert!((noisy / reference - 2.0).abs() < 0.01, "{}", noisy / reference);
        let dense = limit(plane(1e-3, 20)).unwrap();
        assert!((dense / reference - 0.5).abs() < 0.03, "{}", dense / reference);
    }

    #[test]
    fn measurements_of_the_other_side_and_outliers_do_not_count() {
        let reference = limit(plane(1e-3, 8)).unwrap();
        let mut measurements = plane(1e-3, 8);
        let mut back = plane(1e-3, 8);
        back.iter_mut().for_each(|m| m.normal = -Vec3::z());
        let mut outliers = plane(1e-3, 8);
        outliers.iter_mut().for_each(|m| m.class = MeasurementClass::Outlier);
        measurements.extend(back);
        measurements.extend(outliers);
        assert!((limit(measurements).unwrap() / reference - 1.0).abs() < 1e-9);
    }

    #[test]
    fn without_measurements_there_is_no_limit() {
        assert_eq!(limit(Vec::new()), None);
    }
}
