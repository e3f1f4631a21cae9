//! Least squares for the terms of a quadric, where the noise consists of a white part and of a part
//! that the measurements of one scan share.

use crate::geometry::NoiseComponents;
use nalgebra::{Cholesky, Const, SMatrix, SVector};

/// Number of terms of a quadric: 1, u, v, u^2, u v, v^2.
const TERM_COUNT: usize = 6;

/// Values or coefficients of the terms of a quadric.
pub(super) type Terms = SVector<f64, TERM_COUNT>;

/// The terms of a quadric at `(u, v)`.
pub(super) fn quadric_terms(u: f64, v: f64) -> Terms {
    SVector::from([1.0, u, v, u * u, u * v, v * v])
}

/// Prior information on the level, relative to that of the measurements: it only keeps the matrix
/// regular.
const LEVEL_PRIOR: f64 = 1e-9;
/// Prior information for zero slope, relative to that of the measurements on the level, where they
/// lie all round the seed, and how much is added where they lie on one side of it.
const SLOPE_PRIOR: f64 = 1e-3;
const ONE_SIDED_SLOPE_PRIOR: f64 = 0.1;
/// The same for zero curvature.
const CURVATURE_PRIOR: f64 = 1e-2;
const ONE_SIDED_CURVATURE_PRIOR: f64 = 4.0;

/// A measurement over the tangent plane, with lengths in radii and divided by its standard
/// deviation.
pub(super) struct LocalMeasurement {
    /// The terms of the quadric at its place.
    pub terms: Terms,
    /// Its height above the tangent plane.
    pub height: f64,
    /// Index of its scan among those of the fit.
    pub scan: usize,
    /// Weight by the distance from the seed, 0 to 1.
    pub distance_weight: f64,
    /// Weight by the residual, 0 to 1.
    pub robust_weight: f64,
}

impl LocalMeasurement {
    /// The weight that it would have if nothing were shared.
    pub(super) fn weight(&self) -> f64 {
        self.distance_weight * self.robust_weight
    }

    /// Height above the surface with these coefficients, in standard deviations.
    pub(super) fn residual(&self, coefficients: &Terms) -> f64 {
        self.height - self.terms.dot(coefficients)
    }
}

/// The normal equations of generalised least squares, where the measurements of a scan share a
/// random offset (mixed model; Searle, Casella, McCulloch 1992, ch. 6): what they share does not
/// average out within the scan.
///
/// With the weights `W` of a scan's measurements and `V = W^-1 + s 1 1^T`, where `s` is the shared
/// variance, the Sherman-Morrison formula gives
///
/// ```text
/// V^-1 = W - W 1 1^T W s / (1 + s 1^T W 1)                                                     (1)
/// ```
pub(super) struct MixedModelEquations {
    matrix: SMatrix<f64, TERM_COUNT, TERM_COUNT>,
    /// The right-hand side.
    pub right: Terms,
    /// Weight of each measurement if nothing were shared.
    weights: Vec<f64>,
    scans: Vec<ScanSums>,
    noise: NoiseComponents,
}

/// Weighted sums over the measurements of a scan.
#[derive(Clone, Default)]
struct ScanSums {
    terms: Terms,
    height: f64,
    weight: f64,
    /// The factor `s / (1 + s 1^T W 1)` of equation (1).
    shared_factor: f64,
}

impl MixedModelEquations {
    pub(super) fn new(
        local: &[LocalMeasurement],
        scans: usize,
        noise: &NoiseComponents,
    ) -> MixedModelEquations {
        let mut matrix = SMatrix::zeros();
        let mut right = Terms::zeros();
        let mut sums = vec![ScanSums::default(); scans];
        let weights: Vec<f64> = local.iter().map(|l| l.weight() / noise.white).collect();
        for (l, &weight) in local.iter().zip(&weights).filter(|(_, weight)| **weight > 0.0) {
            let terms = l.terms * weight;
            matrix += terms * l.terms.transpose();
            right += terms * l.height;
            let scan = &mut sums[l.scan];
            scan.terms += terms;
            scan.height += l.height * weight;
            scan.weight += weight;
        }
        for scan in &mut sums {
            scan.shared_factor = noise.shared / (1.0 + noise.shared * scan.weight); // (1)
            matrix -= scan.terms * scan.terms.transpose() * scan.shared_factor;
            right -= scan.terms * (scan.height * scan.shared_factor);
        }
        MixedModelEquations { matrix, right, weights, scans: sums, noise: *noise }
    }

    /// The Cholesky factor of the matrix with its priors; `None` if nothing agrees.
    ///
    /// Weak priors for flatness and, weaker, for zero slope decide what the measurements leave
    /// open. They are strong at the border of the measured area, where a curvature would be
    /// extrapolated.
    pub(super) fn factor(&self) -> Option<Cholesky<f64, Const<TERM_COUNT>>> {
        let mut matrix = self.matrix;
        let total = matrix[(0, 0)];
        if total <= 0.0 {
            return None;
        }
        // Squared distance of the measurements' centre from the seed, in radii.
        let one_sided = (matrix[(0, 1)].powi(2) + matrix[(0, 2)].powi(2)) / (total * total);
        let slope = SLOPE_PRIOR + ONE_SIDED_SLOPE_PRIOR * one_sided;
        let curvature = CURVATURE_PRIOR + ONE_SIDED_CURVATURE_PRIOR * one_sided;
        let priors = [LEVEL_PRIOR, slope, slope, curvature, curvature, curvature];
        for (i, prior) in priors.into_iter().enumerate() {
            matrix[(i, i)] += prior * total;
        }
        matrix.cholesky()
    }

    /// Variance of the height at the seed: that of a weighted sum of the measured heights, of which
    /// those of one scan share a part.
    pub(super) fn height_variance(
        &self,
        factor: &Cholesky<f64, Const<TERM_COUNT>>,
        local: &[LocalMeasurement],
    ) -> f64 {
        let mut first = Terms::zeros();
        first[0] = 1.0;
        let influence = factor.solve(&first);
        let common: Vec<f64> =
            self.scans.iter().map(|s| s.shared_factor * s.terms.dot(&influence)).collect();
        let (mut white, mut shared) = (0.0, vec![0.0; self.scans.len()]);
        for (l, weight) in local.iter().zip(&self.weights) {
            let part = weight * (l.terms.dot(&influence) - common[l.scan]);
            white += part * part;
            shared[l.scan] += part;
        }
        self.noise.white * white + self.noise.shared * shared.iter().map(|s| s * s).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// Measurements of a plane, each of unit deviation, by scan: how many and how high.
    fn flat(scans: &[(usize, f64)]) -> Vec<LocalMeasurement> {
        let mut local = Vec::new();
        for (scan, &(count, height)) in scans.iter().enumerate() {
            local.extend((0..count).map(|i| {
                let angle = i as f64 * 2.4;
                LocalMeasurement {
                    terms: quadric_terms(0.7 * angle.cos(), 0.7 * angle.sin()),
                    height,
                    scan,
                    distance_weight: 1.0,
                    robust_weight: 1.0,
                }
            }));
        }
        local
    }

    /// Height of the surface and its variance.
    fn solved(local: &[LocalMeasurement], scans: usize, noise: NoiseComponents) -> (f64, f64) {
        let equations = MixedModelEquations::new(local, scans, &noise);
        let factor = equations.factor().unwrap();
        // In the middle of the ring: half of the height is curvature there.
        let terms = factor.solve(&equations.right);
        (terms[0] + 0.49 * (terms[3] + terms[5]) / 2.0, equations.height_variance(&factor, local))
    }

    #[test]
    fn a_scan_with_many_measurements_does_not_outvote_one_with_few() {
        let local = flat(&[(200, 1.0), (20, -1.0)]);
        let (white, _) = solved(&local, 2, NoiseComponents { white: 1.0, shared: 0.0 });
        let (shared, variance) = solved(&local, 2, NoiseComponents { white: 1.0, shared: 4.0 });
        assert!(white > 0.7, "{white}");
        assert!(shared.abs() < 0.05, "{shared}");
        // Two offsets of variance 4 leave 2, however many measurements there are; priors for
        // flatness only reduce it.
        assert!(variance < 2.3, "{variance}");
    }

    #[test]
    fn the_equations_are_those_of_the_full_covariance() {
        let noise = NoiseComponents { white: 0.6, shared: 1.7 };
        let mut local = flat(&[(12, 0.3), (9, -0.8)]);
        for (i, l) in local.iter_mut().enumerate() {
            l.height += (i as f64).sin();
            l.robust_weight = 0.2 + 0.8 * (i as f64 * 1.3).cos().abs();
        }
        let count = local.len();
        let covariance = DMatrix::from_fn(count, count, |i, j| {
            let own = if i == j { noise.white / local[i].weight() } else { 0.0 };
            own + if local[i].scan == local[j].scan { noise.shared } else { 0.0 }
        });
        let information = covariance.try_inverse().unwrap();
        let design = DMatrix::from_fn(count, TERM_COUNT, |i, j| local[i].terms[j]);
        let heights = DMatrix::from_fn(count, 1, |i, _| local[i].height);
        let matrix = design.transpose() * &information * &design;
        let right = design.transpose() * information * heights;
        let equations = MixedModelEquations::new(&local, 2, &noise);
        for i in 0..TERM_COUNT {
            assert!((equations.right[i] - right[i]).abs() < 1e-9, "{i}");
            for j in 0..TERM_COUNT {
                assert!((equations.matrix[(i, j)] - matrix[(i, j)]).abs() < 1e-9, "{i} {j}");
            }
        }
    }

    #[test]
    fn without_weight_there_is_no_factor() {
        let mut local = flat(&[(10, 1.0)]);
        local.iter_mut().for_each(|l| l.robust_weight = 0.0);
        assert!(MixedModelEquations::new(&local, 1, &NoiseComponents::WHITE).factor().is_none());
    }
}
