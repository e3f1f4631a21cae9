//! Makes correlated noise white.
//!
//! A measurement minus what its neighbours already predict of its noise is independent of them
//! (Vecchia 1988, Estimation and Model Identification for Continuous Spatial Processes):
//!
//! ```text
//! e_i' = (e_i - sum_j b_ij e_j) / sqrt(d_i),    b_i = K_NN^-1 k_N,    d_i = 1 - k_N . b_i    (1)
//! ```
//!
//! over the nearest N of those that precede it in an order which is random in space, so that the
//! first see far neighbours and the last near ones. Scans whose patches are shifted as a whole
//! still measure well how the surface changes within a patch: edges and folds hold a scan far
//! better than their number of points suggests.

use super::correlation::Correlation;
use crate::geometry::{KdTree, Vec3};
use nalgebra::{DMatrix, DVector};

/// Neighbours that a measurement is conditioned on; twice as many take twice the time and change
/// nothing.
const MAX_NEIGHBOURS: usize = 5;
/// Nearest neighbours among which the preceding ones are searched.
const CANDIDATE_COUNT: usize = 40;
/// The share of the variance that the neighbours leave is at least this.
const MIN_VARIANCE: f64 = 1e-3;

/// One row of (1).
pub(super) struct WhiteRow {
    /// Measurements and their coefficients; the measurement that is whitened comes first.
    pub terms: Vec<(usize, f64)>,
}

/// The rows that whiten measurements at these positions (metres, across the line of sight).
pub(super) fn whiten(positions: &[Vec3], correlation: &Correlation) -> Vec<WhiteRow> {
    if correlation.share == 0.0 {
        return (0..positions.len()).map(|i| WhiteRow { terms: vec![(i, 1.0)] }).collect();
    }
    let mut order: Vec<usize> = (0..positions.len()).collect();
    order.sort_by_key(|&i| (scrambled(i), i));
    let predecessors = Predecessors::new(positions, &order);
    order
        .iter()
        .map(|&own| white_row(positions, own, &predecessors.nearest(own), correlation))
        .collect()
}

/// A number without any pattern in `index` (Knuth's multiplicative hash).
fn scrambled(index: usize) -> u64 {
    let mixed = (index as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    mixed ^ (mixed >> 29)
}

/// The row (1) of measurement `own`, given the measurements `near`.
fn white_row(
    positions: &[Vec3],
    own: usize,
    near: &[usize],
    correlation: &Correlation,
) -> WhiteRow {
    let between_neighbours = DMatrix::from_fn(near.len(), near.len(), |r, c| {
        if r == c { 1.0 } else { rho(positions, near[r], near[c], correlation) }
    });
    let with_neighbours =
        DVector::from_fn(near.len(), |r, _| rho(positions, own, near[r], correlation));
    let Some(cholesky) = between_neighbours.cholesky() else {
        return WhiteRow { terms: vec![(own, 1.0)] };
    };
    let coefficients = cholesky.solve(&with_neighbours); // (1), b_i
    let variance = (1.0 - with_neighbours.dot(&coefficients)).max(MIN_VARIANCE); // (1), d_i
    let scale = variance.sqrt().recip();
    let others = near.iter().zip(coefficients.iter()).map(|(&j, b)| (j, -b * scale));
    WhiteRow { terms: std::iter::once((own, scale)).chain(others).collect() }
}

/// Correlation of two measurements.
fn rho(positions: &[Vec3], a: usize, b: usize, correlation: &Correlation) -> f64 {
    correlation.at((positions[a] - positions[b]).norm())
}

/// Finds the nearest of the measurements that precede one.
struct Predecessors<'a> {
    positions: &'a [Vec3],
    order: &'a [usize],
    /// Position of each measurement in the order.
    rank: Vec<usize>,
    tree: KdTree,
}

impl<'a> Predecessors<'a> {
    fn new(positions: &'a [Vec3], order: &'a [usize]) -> Predecessors<'a> {
        let mut rank = vec![0; positions.len()];
        order.iter().enumerate().for_each(|(k, &i)| rank[i] = k);
        Predecessors { positions, order, rank, tree: KdTree::new(positions) }
    }

    /// The nearest predecessors, nearest first.
    fn nearest(&self, own: usize) -> Vec<usize> {
        let rank = self.rank[own];
        // Enough of the nearest neighbours precede this one, unless it is among the first.
        let candidates = self.tree.nearest_n(&self.positions[own], CANDIDATE_COUNT);
        let near: Vec<usize> = candidates
            .into_iter()
            .map(|(j, _)| j)
            .filter(|&j| self.rank[j] < rank)
            .take(MAX_NEIGHBOURS)
            .collect();
        if near.len() == MAX_NEIGHBOURS { near } else { self.nearest_of_all(own, rank) }
    }

    /// The nearest of all predecessors, by sorting.
    fn nearest_of_all(&self, own: usize, rank: usize) -> Vec<usize> {
        let mut found = self.order[..rank].to_vec();
        found.sort_by(|&a, &b| {
            self.square_distance(own, a).total_cmp(&self.square_distance(own, b)).then(a.cmp(&b))
        });
        found.truncate(MAX_NEIGHBOURS);
        found
    }

    fn square_distance(&self, own: usize, other: usize) -> f64 {
        (self.positions[other] - self.positions[own]).norm_squared()
    }
}

#[cfg(test)]
mod tests {
    use super::super::correlation::Residuals;
    use super::super::correlation_tests::moving_averages;
    use super::*;

    /// A linear combination of a scan's values.
    fn combine(row: &WhiteRow, value: impl Fn(usize) -> f64) -> f64 {
        row.terms.iter().map(|&(i, coefficient)| coefficient * value(i)).sum()
    }

    fn whitened(scan: &Residuals, correlation: &Correlation) -> Residuals {
        let rows = whiten(&scan.positions, correlation);
        Residuals {
            positions: rows.iter().map(|row| scan.positions[row.terms[0].0]).collect(),
            values: rows.iter().map(|row| combine(row, |i| scan.values[i])).collect(),
        }
    }

    #[test]
    fn a_whitened_moving_average_is_nearly_white() {
        let scans = moving_averages(4);
        let correlation = Correlation::estimate(&scans, 1.0);
        let white: Vec<Residuals> = scans.iter().map(|scan| whitened(scan, &correlation)).collect();
        assert_eq!(Correlation::estimate(&white, 1.0), Correlation::NONE);
        let all: Vec<f64> = white.iter().flat_map(|scan| scan.values.iter().copied()).collect();
        let variance = all.iter().map(|v| v * v).sum::<f64>() / all.len() as f64;
        assert!((0.5..1.5).contains(&variance), "{variance}");
    }

    #[test]
    fn without_correlation_measurements_stay_as_they_are() {
        let positions = [Vec3::zeros(), Vec3::x()];
        let rows = whiten(&positions, &Correlation::NONE);
        assert!(rows.iter().enumerate().all(|(i, row)| row.terms == [(i, 1.0)]));
    }

    #[test]
    fn few_measurements_become_exactly_white() {
        // All predecessors are neighbours, so that the rows W fulfil W K W^T = I.
        let positions = [Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::new(1.3, 0.4, 0.0)];
        let correlation = Correlation { share: 0.8, length: 1.5 };
        let mut rows = DMatrix::zeros(positions.len(), positions.len());
        for (r, row) in whiten(&positions, &correlation).iter().enumerate() {
            row.terms.iter().for_each(|&(c, coefficient)| rows[(r, c)] = coefficient);
        }
        let covariance = DMatrix::from_fn(positions.len(), positions.len(), |a, b| {
            rho(&positions, a, b, &correlation)
        });
        let white = &rows * covariance * rows.transpose();
        assert!((white - DMatrix::identity(positions.len(), positions.len())).amax() < 1e-12);
    }

    #[test]
    fn the_nearest_predecessors_are_those_found_by_sorting() {
        let scan = &moving_averages(1)[0];
        let mut order: Vec<usize> = (0..scan.positions.len()).collect();
        order.sort_by_key(|&i| (scrambled(i), i));
        let predecessors = Predecessors::new(&scan.positions, &order);
        for own in (0..order.len()).step_by(97) {
            let found = predecessors.nearest(own);
            let expected = predecessors.nearest_of_all(own, predecessors.rank[own]);
            // Of several at one distance, either may be taken.
            for (a, b) in found.iter().zip(&expected) {
                let distances = [a, b].map(|&j| predecessors.square_distance(own, j));
                assert_eq!(distances[0], distances[1], "{own}");
            }
        }
    }

    /// The height of `step` in a scan's values, by least squares of the whitened equations.
    fn step_height(scan: &Residuals, correlation: &Correlation) -> f64 {
        let (mut numerator, mut denominator) = (0.0, 0.0);
        for row in whiten(&scan.positions, correlation) {
            let shape = combine(&row, |i| if scan.positions[i].x < 20.0 { -0.5 } else { 0.5 });
            numerator += shape * combine(&row, |i| scan.values[i]);
            denominator += shape * shape;
        }
        numerator / denominator
    }

    fn rms_step_height(scans: &[Residuals], correlation: &Correlation) -> f64 {
        let squares = scans.iter().map(|scan| step_height(scan, correlation).powi(2));
        (squares.sum::<f64>() / scans.len() as f64).sqrt()
    }

    #[test]
    fn an_edge_is_measured_better_by_taking_out_shared_noise() {
        // The true height of a step in the middle of the square is zero.
        let scans = moving_averages(6);
        let correlation = Correlation::estimate(&scans, 1.0);
        let plain = rms_step_height(&scans, &Correlation::NONE);
        let white = rms_step_height(&scans, &correlation);
        assert!(white < 0.8 * plain, "{white} {plain}");
    }
}
