//! The normal equations of the joint optimisation.
//!
//! Unknown are the scans' poses and the heights of the patches. Rows `J xi_k - sum_s c_s m_s + r` of unit variance give
//!
//! ```text
//! | A   -B | | xi |     | J^T r |
//! | -B^T M | | m  | = - | -C^T r |,      (A - B M^-1 B^T) xi = -(J^T r - B M^-1 C^T r)            (1)
//! ```
//!
//! with A = J^T J, B = J^T C, M = C^T C: the Schur complement by the heights (Triggs et al. 2000, Bundle Adjustment, §6.1).

use crate::geometry::{Mat6, Twist};
use crate::{Error, Result};
use faer::linalg::solvers::Solve;
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Side};
use nalgebra::{DMatrix, DVector};

/// One equation of unit variance.
pub(crate) struct Row {
    pub jacobian: Twist,
    pub residual: f64,
    /// Patches and their coefficients.
    pub heights: Vec<(u32, f64)>,
}

/// Hessian and gradient (1) of the poses' half squared error; one list of rows a scan.
///
/// # Errors
/// [`Error::Input`] if the rows do not determine the heights.
pub(crate) fn reduced(scans: &[Vec<Row>], patches: usize) -> Result<(DMatrix<f64>, DVector<f64>)> {
    let size = 6 * scans.len();
    let (mut hessian, mut gradient) = (DMatrix::zeros(size, size), DVector::zeros(size));
    let seen = numbered(scans, patches);
    let count = seen.iter().flatten().count();
    if count == 0 {
        return Ok((hessian, gradient));
    }
    // B^T and, in the last column, C^T r.
    let mut coupling = DMatrix::zeros(count, size + 1);
    let mut triplets = Vec::new();
    for (k, rows) in scans.iter().enumerate() {
        let (mut block, mut slope) = (Mat6::zeros(), Twist::zeros());
        for row in rows {
            block += row.jacobian * row.jacobian.transpose();
            slope += row.jacobian * row.residual;
            let heights = row.heights.iter().filter_map(|(s, c)| Some((seen[*s as usize]?, *c)));
            let heights: Vec<(usize, f64)> = heights.collect();
            for &(s, c) in &heights {
                for i in 0..6 {
                    coupling[(s, 6 * k + i)] += c * row.jacobian[i];
                }
                coupling[(s, size)] += c * row.residual;
                let lower = heights.iter().filter(|(t, _)| *t >= s);
                triplets.extend(lower.map(|&(t, d)| Triplet::new(t, s, c * d)));
            }
        }
        hessian.fixed_view_mut::<6, 6>(6 * k, 6 * k).copy_from(&block);
        gradient.fixed_rows_mut::<6>(6 * k).copy_from(&slope);
    }
    let solved = solve(count, &triplets, &coupling)?;
    let couples = coupling.columns(0, size);
    let product = couples.transpose() * solved;
    hessian -= product.columns(0, size);
    gradient -= product.column(size);
    // Rounding leaves it symmetric to 1e-16 only.
    hessian = (&hessian + hessian.transpose()) * 0.5;
    Ok((hessian, gradient))
}

/// The patches that occur, numbered.
fn numbered(scans: &[Vec<Row>], patches: usize) -> Vec<Option<usize>> {
    let mut seen = vec![None; patches];
    for (patch, _) in scans.iter().flatten().flat_map(|row| &row.heights) {
        seen[*patch as usize] = Some(0);
    }
    for (number, slot) in seen.iter_mut().flatten().enumerate() {
        *slot = number;
    }
    seen
}

/// M^-1 times the columns of `right`; `lower` holds the lower half of M.
fn solve(
    size: usize,
    lower: &[Triplet<usize, usize, f64>],
    right: &DMatrix<f64>,
) -> Result<DMatrix<f64>> {
    let singular =
        || Error::input("the joint registration is singular: no patch of the surface is measured");
    let matrix = SparseColMat::<usize, f64>::try_new_from_triplets(size, size, lower)
        .map_err(|_| singular())?;
    let factor = matrix.sp_cholesky(Side::Lower).map_err(|_| singular())?;
    let mut solution = Mat::from_fn(size, right.ncols(), |r, c| right[(r, c)]);
    factor.solve_in_place(&mut solution);
    Ok(DMatrix::from_fn(size, right.ncols(), |r, c| solution[(r, c)]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_schur_complement_is_that_of_the_whole_system() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        const PATCHES: usize = 12;
        let mut row = |own: usize| Row {
            jacobian: Twist::from_fn(|_, _| rng.random_range(-1.0..1.0)),
            residual: rng.random_range(-1.0..1.0),
            heights: vec![
                (own as u32, 1.5),
                (((own + 5) % PATCHES) as u32, rng.random_range(-1.0..0.0)),
            ],
        };
        let scans: Vec<Vec<Row>> =
            (0..3).map(|k| (k..PATCHES).chain(0..PATCHES).map(&mut row).collect()).collect();
        let total: usize = scans.iter().map(Vec::len).sum();
        let mut whole = DMatrix::zeros(total, 18 + PATCHES);
        let mut residuals = DVector::zeros(total);
        let all = scans.iter().enumerate().flat_map(|(k, rows)| rows.iter().map(move |r| (k, r)));
        for (i, (k, row)) in all.enumerate() {
            (0..6).for_each(|j| whole[(i, 6 * k + j)] = row.jacobian[j]);
            row.heights.iter().for_each(|(s, c)| whole[(i, 18 + *s as usize)] -= c);
            residuals[i] = row.residual;
        }
        let normal = whole.transpose() * &whole;
        let inverse = normal.try_inverse().unwrap();
        let step = -(&inverse * whole.transpose() * residuals);
        let (hessian, gradient) = reduced(&scans, PATCHES).unwrap();
        let covariance = hessian.try_inverse().unwrap();
        assert!((&covariance - inverse.view((0, 0), (18, 18))).amax() < 1e-9);
        assert!((covariance * -gradient - step.rows(0, 18)).amax() < 1e-9);
    }
}
