//! Least squares for the terms of a quadric where the noise is made of a white part and one that the measurements of a scan
//! share.

use crate::geometry::Components;
use nalgebra::{Cholesky, Const, SMatrix, SVector};

/// Of a quadric: 1, u, v, u^2, u v, v^2.
const TERMS: usize = 6;

pub(super) type Terms = SVector<f64, TERMS>;

/// A measurement over the tangent plane, lengths in radii, divided by its standard deviation.
pub(super) struct Local {
    pub terms: Terms,
    pub height: f64,
    pub scan: usize,
    /// By distance from the seed.
    pub near: f64,
    pub robust: f64,
}

impl Local {
    /// Weight if nothing were shared.
    pub(super) fn weight(&self) -> f64 {
        self.near * self.robust
    }

    /// Height above the surface with these coefficients, in standard deviations.
    pub(super) fn residual(&self, coefficients: &Terms) -> f64 {
        self.height - self.terms.dot(coefficients)
    }
}

/// Generalised least squares, where the measurements of a scan share a random offset (mixed model; Searle, Casella,
/// McCulloch 1992, ch. 6): what they share does not average out within the scan.
pub(super) struct Equations {
    matrix: SMatrix<f64, TERMS, TERMS>,
    pub right: Terms,
    /// Of each measurement, if nothing were shared.
    weights: Vec<f64>,
    scans: Vec<Shared>,
    noise: Components,
}

/// What the measurements of a scan have in common, each in its standard deviations.
#[derive(Clone, Default)]
struct Shared {
    terms: Terms,
    height: f64,
    weight: f64,
    /// The part of the sums that their common offset may explain.
    part: f64,
}

impl Equations {
    pub(super) fn new(local: &[Local], scans: usize, noise: &Components) -> Equations {
        let mut matrix = SMatrix::zeros();
        let mut right = Terms::zeros();
        let mut shared = vec![Shared::default(); scans];
        let weights: Vec<f64> = local.iter().map(|l| l.weight() / noise.white).collect();
        for (l, &weight) in local.iter().zip(&weights).filter(|(_, weight)| **weight > 0.0) {
            let terms = l.terms * weight;
            matrix += terms * l.terms.transpose();
            right += terms * l.height;
            let scan = &mut shared[l.scan];
            scan.terms += terms;
            scan.height += l.height * weight;
            scan.weight += weight;
        }
        for scan in &mut shared {
            scan.part = noise.shared / (1.0 + noise.shared * scan.weight);
            matrix -= scan.terms * scan.terms.transpose() * scan.part;
            right -= scan.terms * (scan.height * scan.part);
        }
        Equations { matrix, right, weights, scans: shared, noise: *noise }
    }

    /// `None` if nothing agrees.
    pub(super) fn factor(&self) -> Option<Cholesky<f64, Const<TERMS>>> {
        let mut matrix = self.matrix;
        let total = matrix[(0, 0)];
        if total <= 0.0 {
            return None;
        }
        // A weak belief in flatness (and, weaker, in zero slope) decides where measurements cannot. It is strong
        // at the border of the measured area, where a curvature would be an extrapolation.
        let aside = (matrix[(0, 1)].powi(2) + matrix[(0, 2)].powi(2)) / (total * total);
        let (slope, curvature) = (1e-3 + 0.1 * aside, 1e-2 + 4.0 * aside);
        let beliefs = [1e-9, slope, slope, curvature, curvature, curvature];
        for (i, belief) in beliefs.into_iter().enumerate() {
            matrix[(i, i)] += belief * total;
        }
        matrix.cholesky()
    }

    /// Variance of the height at the seed: that of a sum of the heights, of which those of one scan share a part.
    pub(super) fn variance(&self, factor: &Cholesky<f64, Const<TERMS>>, local: &[Local]) -> f64 {
        let mut first = Terms::zeros();
        first[0] = 1.0;
        let influence = factor.solve(&first);
        let common: Vec<f64> =
            self.scans.iter().map(|s| s.part * s.terms.dot(&influence)).collect();
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

    /// Measurements of a plane, each of unit deviation, by scan: how many and how high.
    fn flat(scans: &[(usize, f64)]) -> Vec<Local> {
        let of_scan = |(scan, &(count, height)): (usize, &(usize, f64))| -> Vec<Local> {
            let at = |i: usize| {
                let angle = i as f64 * 2.4;
                let (a, b) = (0.7 * angle.cos(), 0.7 * angle.sin());
                let terms = SVector::from([1.0, a, b, a * a, a * b, b * b]);
                Local { terms, height, scan, near: 1.0, robust: 1.0 }
            };
            (0..count).map(at).collect()
        };
        scans.iter().enumerate().flat_map(of_scan).collect()
    }

    /// Height of the surface and its variance.
    fn solved(local: &[Local], scans: usize, noise: Components) -> (f64, f64) {
        let equations = Equations::new(local, scans, &noise);
        let factor = equations.factor().unwrap();
        // In the middle of the ring: half of the height is curvature there.
        let terms = factor.solve(&equations.right);
        (terms[0] + 0.49 * (terms[3] + terms[5]) / 2.0, equations.variance(&factor, local))
    }

    #[test]
    fn a_scan_with_many_measurements_does_not_outvote_one_with_few() {
        let local = flat(&[(200, 1.0), (20, -1.0)]);
        let (white, _) = solved(&local, 2, Components { white: 1.0, shared: 0.0 });
        let (shared, variance) = solved(&local, 2, Components { white: 1.0, shared: 4.0 });
        assert!(white > 0.7, "{white}");
        assert!(shared.abs() < 0.05, "{shared}");
        // Two offsets of variance 4 leave 2, however many measurements there are; beliefs in flatness only less.
        assert!(variance < 2.3, "{variance}");
    }
}
