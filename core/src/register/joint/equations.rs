//! The normal equations of the joint optimisation.
//!
//! The unknowns are the motions xi of the scans' poses and the heights m of the surfels. Rows
//! `J xi_k - sum_s c_s m_s + r` of unit variance give
//!
//! ```text
//! | A   -B | | xi |     | J^T r |
//! | -B^T M | | m  | = - | -C^T r |,      (A - B M^-1 B^T) xi = -(J^T r - B M^-1 C^T r)    (1)
//! ```
//!
//! with A = J^T J, B = J^T C, M = C^T C. The right side eliminates the heights by their Schur
//! complement (Triggs et al. 2000, Bundle Adjustment, §6.1).

use crate::geometry::{Mat6, Twist};
use crate::{Error, Result};
use faer::linalg::solvers::Solve;
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Side};
use nalgebra::{DMatrix, DVector};

/// One equation of unit variance.
pub(super) struct Row {
    /// Derivative of the residual by the scan's pose.
    pub jacobian: Twist,
    pub residual: f64,
    /// Surfels whose heights are subtracted, with their coefficients c_s.
    pub heights: Vec<(u32, f64)>,
}

/// Hessian and gradient of the poses' half squared error by (1), in the scans' order, from one list
/// of rows a scan and the number of surfels.
///
/// # Errors
/// [`Error::Input`] if the rows do not determine the heights.
pub(super) fn reduced_equations(
    scans: &[Vec<Row>],
    surfel_count: usize,
) -> Result<(DMatrix<f64>, DVector<f64>)> {
    let size = 6 * scans.len();
    let (mut hessian, mut gradient) = (DMatrix::zeros(size, size), DVector::zeros(size));
    let numbers = number_surfels(scans, surfel_count);
    let count = numbers.iter().flatten().count();
    if count == 0 {
        return Ok((hessian, gradient));
    }
    // B^T and, in the last column, C^T r.
    let mut coupling = DMatrix::zeros(count, size + 1);
    // The lower half of M.
    let mut height_triplets = Vec::new();
    for (k, rows) in scans.iter().enumerate() {
        let (mut block, mut block_gradient) = (Mat6::zeros(), Twist::zeros());
        for row in rows {
            block += row.jacobian * row.jacobian.transpose();
            block_gradient += row.jacobian * row.residual;
            let heights: Vec<(usize, f64)> = row
                .heights
                .iter()
                .filter_map(|(surfel, c)| Some((numbers[*surfel as usize]?, *c)))
                .collect();
            for &(s, c) in &heights {
                for i in 0..6 {
                    coupling[(s, 6 * k + i)] += c * row.jacobian[i];
                }
                coupling[(s, size)] += c * row.residual;
                let lower = heights.iter().filter(|(t, _)| *t >= s);
                height_triplets.extend(lower.map(|&(t, d)| Triplet::new(t, s, c * d)));
            }
        }
        hessian.fixed_view_mut::<6, 6>(6 * k, 6 * k).copy_from(&block);
        gradient.fixed_rows_mut::<6>(6 * k).copy_from(&block_gradient);
    }
    let solved = solve_heights(count, &height_triplets, &coupling)?;
    let product = coupling.columns(0, size).transpose() * solved;
    hessian -= product.columns(0, size); // (1), A - B M^-1 B^T
    gradient -= product.column(size); // (1), J^T r - B M^-1 C^T r
    // Rounding leaves it symmetric to 1e-16 only.
    hessian = (&hessian + hessian.transpose()) * 0.5;
    Ok((hessian, gradient))
}

/// Consecutive numbers of the surfels that occur in rows; `None` for the others.
fn number_surfels(scans: &[Vec<Row>], surfel_count: usize) -> Vec<Option<usize>> {
    let mut numbers = vec![None; surfel_count];
    for (surfel, _) in scans.iter().flatten().flat_map(|row| &row.heights) {
        numbers[*surfel as usize] = Some(0);
    }
    for (number, slot) in numbers.iter_mut().flatten().enumerate() {
        *slot = number;
    }
    numbers
}

/// M^-1 times the columns of `right`; `lower` holds the lower half of M.
fn solve_heights(
    size: usize,
    lower: &[Triplet<usize, usize, f64>],
    right: &DMatrix<f64>,
) -> Result<DMatrix<f64>> {
    let matrix = SparseColMat::<usize, f64>::try_new_from_triplets(size, size, lower)
        .map_err(|_| singular())?;
    let factor = matrix.sp_cholesky(Side::Lower).map_err(|_| singular())?;
    let mut solution = Mat::from_fn(size, right.ncols(), |r, c| right[(r, c)]);
    factor.solve_in_place(&mut solution);
    Ok(DMatrix::from_fn(size, right.ncols(), |r, c| solution[(r, c)]))
}

fn singular() -> Error {
    Error::input("the joint registration is singular: no patch of the surface is measured")
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const SURFEL_COUNT: usize = 12;
    const SCAN_COUNT: usize = 3;
    /// Number of the poses' unknowns.
    const POSES: usize = 6 * SCAN_COUNT;

    fn random_row(own: usize, rng: &mut ChaCha8Rng) -> Row {
        Row {
            jacobian: Twist::from_fn(|_, _| rng.random_range(-1.0..1.0)),
            residual: rng.random_range(-1.0..1.0),
            heights: vec![
                (own as u32, 1.5),
                (((own + 5) % SURFEL_COUNT) as u32, rng.random_range(-1.0..0.0)),
            ],
        }
    }

    fn random_rows() -> Vec<Vec<Row>> {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        (0..SCAN_COUNT)
            .map(|k| {
                let owners = (k..SURFEL_COUNT).chain(0..SURFEL_COUNT);
                owners.map(|own| random_row(own, &mut rng)).collect()
            })
            .collect()
    }

    /// The equations with the heights as unknowns: coefficients and residuals.
    fn dense(scans: &[Vec<Row>]) -> (DMatrix<f64>, DVector<f64>) {
        let total: usize = scans.iter().map(Vec::len).sum();
        let mut coefficients = DMatrix::zeros(total, POSES + SURFEL_COUNT);
        let mut residuals = DVector::zeros(total);
        let mut i = 0;
        for (k, rows) in scans.iter().enumerate() {
            for row in rows {
                (0..6).for_each(|j| coefficients[(i, 6 * k + j)] = row.jacobian[j]);
                row.heights.iter().for_each(|(s, c)| coefficients[(i, POSES + *s as usize)] -= c);
                residuals[i] = row.residual;
                i += 1;
            }
        }
        (coefficients, residuals)
    }

    /// Half squared error at a motion of the poses, with the heights that are best there.
    fn half_squared_error(scans: &[Vec<Row>], motion: &DVector<f64>) -> f64 {
        let (coefficients, residuals) = dense(scans);
        let at_motion = &residuals + coefficients.columns(0, POSES) * motion;
        let heights = coefficients.columns(POSES, SURFEL_COUNT).into_owned();
        let best = heights.clone().svd(true, true).solve(&-&at_motion, 1e-12).unwrap();
        0.5 * (at_motion + heights * best).norm_squared()
    }

    #[test]
    fn the_schur_complement_is_that_of_the_whole_system() {
        let scans = random_rows();
        let (whole, residuals) = dense(&scans);
        let normal = whole.transpose() * &whole;
        let inverse = normal.try_inverse().unwrap();
        let step = -(&inverse * whole.transpose() * residuals);
        let (hessian, gradient) = reduced_equations(&scans, SURFEL_COUNT).unwrap();
        let covariance = hessian.try_inverse().unwrap();
        assert!((&covariance - inverse.view((0, 0), (POSES, POSES))).amax() < 1e-9);
        assert!((covariance * -gradient - step.rows(0, POSES)).amax() < 1e-9);
    }

    #[test]
    fn gradient_and_hessian_agree_with_finite_differences_of_the_least_error() {
        let scans = random_rows();
        let (hessian, gradient) = reduced_equations(&scans, SURFEL_COUNT).unwrap();
        let zero = half_squared_error(&scans, &DVector::zeros(POSES));
        const STEP: f64 = 1e-3;
        for k in 0..POSES {
            let mut motion = DVector::zeros(POSES);
            motion[k] = STEP;
            let (up, down) =
                (half_squared_error(&scans, &motion), half_squared_error(&scans, &-&motion));
            // The error is quadratic: central differences are exact but for rounding.
            assert!(((up - down) / (2.0 * STEP) - gradient[k]).abs() < 1e-8, "{k}");
            let curvature = (up + down - 2.0 * zero) / (STEP * STEP);
            assert!((curvature - hessian[(k, k)]).abs() < 1e-6, "{k}: {curvature}");
        }
    }

    #[test]
    fn surfels_without_rows_do_not_matter_and_no_rows_give_zero() {
        let scans = random_rows();
        let (hessian, gradient) = reduced_equations(&scans, SURFEL_COUNT).unwrap();
        let more = reduced_equations(&scans, SURFEL_COUNT + 7).unwrap();
        assert_eq!((hessian, gradient), more);
        let (hessian, gradient) = reduced_equations(&[Vec::new(), Vec::new()], 3).unwrap();
        assert_eq!((hessian.amax(), gradient.amax(), hessian.nrows()), (0.0, 0.0, 12));
    }
}
