//! Correlated noise made white.
//!
//! A measurement minus what its neighbours already tell of its noise is independent of them (Vecchia 1988, Estimation
//! and Model Identification for Continuous Spatial Processes):
//!
//! ```text
//! e_i' = (e_i - sum_j b_ij e_j) / sqrt(d_i),    b_i = K_NN^-1 k_N,    d_i = 1 - k_N . b_i                (1)
//! ```
//!
//! over the nearest N of those that come before it in an order which is random in space, so that the first see far
//! neighbours and the last near ones. Scans whose patches are shifted as a whole still measure well how the surface
//! changes within a patch: edges and folds hold a scan far better than their number of points suggests.

use super::correlation::Correlation;
use crate::geometry::{KdTree, Vec3};
use nalgebra::{DMatrix, DVector};

/// Neighbours that a measurement is conditioned on; twice as many take twice the time and change nothing.
const NEIGHBOURS: usize = 5;
/// Nearest neighbours among which those that come before are looked for.
const CANDIDATES: usize = 40;
/// The share of the variance that neighbours leave is at least this.
const LEAST_VARIANCE: f64 = 1e-3;

/// One row of (1): the coefficients of the measurements, `index`'s own first.
pub(crate) struct WhiteRow {
    pub terms: Vec<(usize, f64)>,
}

/// The rows that whiten measurements at these places (metres, across the line of sight).
pub(crate) fn whiten(at: &[Vec3], correlation: &Correlation) -> Vec<WhiteRow> {
    if correlation.share == 0.0 {
        return (0..at.len()).map(|i| WhiteRow { terms: vec![(i, 1.0)] }).collect();
    }
    let mut order: Vec<usize> = (0..at.len()).collect();
    order.sort_by_key(|&i| (scattered(i), i));
    let before = Before::new(at, &order);
    order.iter().map(|&own| row(at, own, &before.nearest(own), correlation)).collect()
}

/// A number without any pattern in `index` (Knuth's multiplicative hash).
fn scattered(index: usize) -> u64 {
    let mixed = (index as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    mixed ^ (mixed >> 29)
}

fn row(at: &[Vec3], own: usize, near: &[usize], correlation: &Correlation) -> WhiteRow {
    let rho = |a: usize, b: usize| correlation.at((at[a] - at[b]).norm());
    let among =
        DMatrix::from_fn(
            near.len(),
            near.len(),
            |r, c| {
                if r == c { 1.0 } else { rho(near[r], near[c]) }
            },
        );
    let with = DVector::from_fn(near.len(), |r, _| rho(own, near[r]));
    let alone = WhiteRow { terms: vec![(own, 1.0)] };
    let Some(cholesky) = among.cholesky() else { return alone };
    let coefficients = cholesky.solve(&with);
    let scale = (1.0 - with.dot(&coefficients)).max(LEAST_VARIANCE).sqrt().recip();
    let others = near.iter().zip(coefficients.iter()).map(|(&j, b)| (j, -b * scale));
    WhiteRow { terms: std::iter::once((own, scale)).chain(others).collect() }
}

/// Finds the nearest of those that come before a measurement.
struct Before<'a> {
    at: &'a [Vec3],
    order: &'a [usize],
    /// Where in the order each stands.
    rank: Vec<usize>,
    tree: KdTree,
}

impl<'a> Before<'a> {
    fn new(at: &'a [Vec3], order: &'a [usize]) -> Before<'a> {
        let mut rank = vec![0; at.len()];
        order.iter().enumerate().for_each(|(k, &i)| rank[i] = k);
        Before { at, order, rank, tree: KdTree::new(at) }
    }

    /// Nearest first.
    fn nearest(&self, own: usize) -> Vec<usize> {
        let rank = self.rank[own];
        // Of the nearest neighbours of any rank, enough come before, unless this one is among the first.
        let near = self.tree.nearest_n(&self.at[own], CANDIDATES).into_iter().map(|(j, _)| j);
        let near: Vec<usize> = near.filter(|&j| self.rank[j] < rank).take(NEIGHBOURS).collect();
        if near.len() == NEIGHBOURS { near } else { self.among_first(own, rank) }
    }

    fn among_first(&self, own: usize, rank: usize) -> Vec<usize> {
        let distance = |j: &usize| (self.at[*j] - self.at[own]).norm_squared();
        let mut found = self.order[..rank].to_vec();
        found.sort_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)));
        found.truncate(NEIGHBOURS);
        found
    }
}

#[cfg(test)]
mod tests {
    use super::super::correlation::{Residuals, tests::scans};
    use super::*;

    #[test]
    fn what_is_left_of_a_moving_average_is_nearly_white() {
        let scans = scans(4);
        let correlation = Correlation::learn(&scans, 1.0);
        let whitened: Vec<Residuals> = scans
            .iter()
            .map(|scan| {
                let rows = whiten(&scan.at, &correlation);
                let value =
                    |row: &WhiteRow| row.terms.iter().map(|(i, c)| c * scan.value[*i]).sum();
                let at = rows.iter().map(|row| scan.at[row.terms[0].0]).collect();
                Residuals { at, value: rows.iter().map(value).collect() }
            })
            .collect();
        assert_eq!(Correlation::learn(&whitened, 1.0), Correlation::NONE);
        let all: Vec<f64> = whitened.iter().flat_map(|s| s.value.iter().copied()).collect();
        let variance = all.iter().map(|v| v * v).sum::<f64>() / all.len() as f64;
        assert!((0.5..1.5).contains(&variance), "{variance}");
    }

    #[test]
    fn without_correlation_each_stands_for_itself() {
        let at = [Vec3::zeros(), Vec3::x()];
        let rows = whiten(&at, &Correlation::NONE);
        assert!(rows.iter().enumerate().all(|(i, row)| row.terms == [(i, 1.0)]));
    }

    #[test]
    fn an_edge_stands_out_of_noise_that_neighbours_share() {
        // The height of a step in the middle of the square, by least squares with and without whitening.
        let scans = scans(6);
        let correlation = Correlation::learn(&scans, 1.0);
        let step = |at: &Vec3| if at.x < 20.0 { -0.5 } else { 0.5 };
        let estimate = |scan: &Residuals, rows: &[WhiteRow]| {
            let (mut above, mut below) = (0.0, 0.0);
            for row in rows {
                let sum = |of: &dyn Fn(usize) -> f64| -> f64 {
                    row.terms.iter().map(|&(i, c)| c * of(i)).sum()
                };
                let shape = sum(&|i| step(&scan.at[i]));
                above += shape * sum(&|i| scan.value[i]);
                below += shape * shape;
            }
            above / below
        };
        let rms = |correlation: &Correlation| {
            let square = |scan| estimate(scan, &whiten(&scan.at, correlation)).powi(2);
            (scans.iter().map(square).sum::<f64>() / scans.len() as f64).sqrt()
        };
        let (plain, white) = (rms(&Correlation::NONE), rms(&correlation));
        assert!(white < 0.8 * plain, "{white} {plain}");
    }
}
