//! How far the joint optimisation may rely on the information of the geometry, direction by
//! direction of all poses together. `judge::observability` answers the same question for a pair of
//! scans.
//!
//! The gradient g of the geometry's half squared error has the variance H = J^T J by the noise of
//! the heights, but a motion of the poses changes it by less than H: noise of the normals, and
//! normals of single scans that are tilted at edges which other scans do not see, add squares to H
//! in directions that the surface leaves undetermined. Growth of the object is such a direction:
//! opposite faces are in no scan together. Products of two scans' *own* normals are free of that.
//! Let a_k be the derivative of a patch's height by a motion of the object frame along the own mean
//! normal of scan k, a that along the mean normal of all scans, w_k the weight of scan k there, and
//! d = xi_k - xi_l:
//!
//! ```text
//! xi^T X xi = sum_s sum_k<l w_k w_l / sum w (a_k . d) (a_l . d)
//! xi^T H xi = sum_s sum_k<l w_k w_l / sum w (a . d)^2                                    (1)
//! ```
//!
//! X has the expectation that noise-free normals give. Of a gradient with slope X and variance H
//! the best linear use is X H^-1 g, whose information is X H^-1 X (optimal estimating function;
//! Godambe & Heyde 1987, Quasi-likelihood and Optimal Estimation). With
//!
//! ```text
//! X v_i = l_i H v_i,   v_i^T H v_j = delta_ij                                            (2)
//! ```
//!
//! this is a geometry that counts by l_i in the direction v_i of the gradient, and by l_i^2 for the
//! covariance. The prior determines the rest. l_i is an estimate, the sum of the patches' products.
//! Its standard error e_i follows from the squares of these products (White 1980, A
//! Heteroskedasticity-Consistent Covariance Matrix Estimator) and from the share of patches that
//! are independent. The estimate is shrunk by the part that cannot be told from zero (positive-part
//! shrinkage; James & Stein 1961),
//!
//! ```text
//! s_i = l_i (1 - (2 e_i / l_i)^2)  if l_i > 2 e_i, else 0;     f_i = s_i + rho (1 - s_i)     (3)
//! ```
//!
//! so that no threshold makes the result jump. Where neighbours share the part rho of their noise,
//! much of the information lies in their differences (`whitening`), which (1) does not see: that
//! part counts as it is.

use crate::geometry::{Mat6, Pose, Twist, Vec3, adjoint};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;

/// The information on a direction must exceed zero by this many standard errors, as in
/// `judge::observability`.
const SIGNIFICANCE_SIGMA: f64 = 2.0;
/// H contains this share of the prior besides, so that directions about which the geometry says
/// nothing at all have a length.
const PRIOR_SHARE: f64 = 0.01;
/// Products of two scans' normals that the standard errors are taken from, at most: of twenty-six
/// dense laser scans about every fifth patch, so that they take little time beside the equations.
const MAX_PRODUCTS: usize = 5_000_000;

/// What the errors of neighbouring patches have in common.
#[derive(Clone, Copy)]
pub(super) struct SharedNoise {
    /// The share of their heights' variance that is common, rho of (3).
    pub height_share: f64,
    /// The share of patches in which the errors of the normals are independent.
    pub independent_normals: f64,
}

/// What one scan saw of one patch of the surface.
pub(super) struct PatchView {
    pub surfel: u32,
    pub scan: usize,
    /// Inverse variance of its height, 1 / square metres.
    pub weight: f64,
    /// Derivative of the patch's height by a motion of the object frame, along the mean normal of
    /// the scan's own points.
    pub own: Twist,
    /// The same along the mean normal of all scans' points.
    pub shared: Twist,
}

/// Two scans' views of one patch.
struct ViewPair<'a> {
    a: &'a PatchView,
    b: &'a PatchView,
    /// w_k w_l / sum w of (1).
    weight: f64,
}

/// The factors by which the information of the geometry counts.
pub(super) struct InformationShrinkage {
    /// L of H = L L^T.
    lower: DMatrix<f64>,
    lower_inverse: DMatrix<f64>,
    /// Columns: L^T v_i.
    directions: DMatrix<f64>,
    /// f_i of (3), by direction.
    factors: Vec<f64>,
}

impl InformationShrinkage {
    /// Computed from `views` of the patches, ordered by patch, by scans at `poses` with the same
    /// `prior` information each; `None` if the prior is infinite or not a number.
    pub(super) fn new(
        views: &[PatchView],
        poses: &[Pose],
        prior: &Mat6,
        noise: SharedNoise,
    ) -> Option<InformationShrinkage> {
        let patches: Vec<&[PatchView]> = views.chunk_by(|a, b| a.surfel == b.surfel).collect();
        let object_from_scan: Vec<Mat6> = poses.iter().map(adjoint).collect();
        let (mut hessian, mut cross) = information_sums(&patches, poses.len());
        to_scan_frames(&mut hessian, &object_from_scan);
        to_scan_frames(&mut cross, &object_from_scan);
        for k in 0..poses.len() {
            let mut block = hessian.fixed_view_mut::<6, 6>(6 * k, 6 * k);
            block += prior * PRIOR_SHARE;
        }
        let lower = hessian.cholesky()?.l();
        let lower_inverse =
            lower.solve_lower_triangular(&DMatrix::identity(lower.nrows(), lower.ncols()))?;
        let relative = &lower_inverse * cross * lower_inverse.transpose();
        // (2). Rounding leaves the matrix symmetric to 1e-16 only.
        let eigen = SymmetricEigen::new((&relative + relative.transpose()) * 0.5);
        // v_i as motions of the object frame.
        let mut motions = lower_inverse.transpose() * &eigen.eigenvectors;
        for (k, adjoint) in object_from_scan.iter().enumerate() {
            let rows = adjoint * motions.fixed_rows::<6>(6 * k);
            motions.fixed_rows_mut::<6>(6 * k).copy_from(&rows);
        }
        let errors = StandardErrors::new(&patches, motions.ncols(), noise.independent_normals);
        let factors = (0..motions.ncols())
            .into_par_iter()
            .map(|i| {
                let error = errors.along(&motions.column(i).into_owned());
                shrinkage_factor(eigen.eigenvalues[i], error, noise.height_share)
            })
            .collect();
        Some(InformationShrinkage { lower, lower_inverse, directions: eigen.eigenvectors, factors })
    }

    /// The part of the geometry's gradient that counts.
    pub(super) fn gradient(&self, gradient: &DVector<f64>) -> DVector<f64> {
        self.scaling(|factor| factor) * gradient
    }

    /// The information of the shrunk gradient; `hessian` is the geometry's.
    pub(super) fn information(&self, hessian: &DMatrix<f64>) -> DMatrix<f64> {
        let scaling = self.scaling(|factor| factor);
        &scaling * hessian * scaling.transpose()
    }

    /// How much the shrunk gradient changes with the poses, at most: Newton steps with it converge
    /// even where the geometry determines more than it seems.
    pub(super) fn stiffness(&self, hessian: &DMatrix<f64>) -> DMatrix<f64> {
        let scaling = self.scaling(f64::sqrt);
        &scaling * hessian * scaling.transpose()
    }

    /// `H V diag(power(factors)) V^T`.
    fn scaling(&self, power: fn(f64) -> f64) -> DMatrix<f64> {
        let mut scaled = self.directions.clone();
        for (mut column, factor) in scaled.column_iter_mut().zip(&self.factors) {
            column *= power(*factor);
        }
        &self.lower * (scaled * self.directions.transpose()) * &self.lower_inverse
    }
}

/// Derivative of the height along `normal` of the point `position` (metres) by a motion of the
/// frame in which both are given.
pub(super) fn height_derivative(normal: &Vec3, position: &Vec3) -> Twist {
    let turn = position.cross(normal);
    Twist::new(normal.x, normal.y, normal.z, turn.x, turn.y, turn.z)
}

/// Pairs of a patch's views with the weights of (1).
fn view_pairs(patch: &[PatchView]) -> impl Iterator<Item = ViewPair<'_>> {
    let total: f64 = patch.iter().map(|view| view.weight).sum();
    patch.iter().enumerate().flat_map(move |(i, a)| {
        patch[i + 1..].iter().map(move |b| ViewPair { a, b, weight: a.weight * b.weight / total })
    })
}

/// H and X of (1) by motions of the object frame.
fn information_sums(patches: &[&[PatchView]], scans: usize) -> (DMatrix<f64>, DMatrix<f64>) {
    let zeros = DMatrix::zeros(6 * scans, 6 * scans);
    let (mut hessian, mut cross) = (zeros.clone(), zeros);
    for ViewPair { a, b, weight } in patches.iter().flat_map(|patch| view_pairs(patch)) {
        let product = a.own * b.own.transpose() * (0.5 * weight);
        add_relative(&mut cross, a.scan, b.scan, &(product + product.transpose())); // (1), X
        let square = a.shared * b.shared.transpose() * weight;
        add_relative(&mut hessian, a.scan, b.scan, &square); // (1), H
    }
    (hessian, cross)
}

/// Adds information on the difference of the motions of scans `a` and `b`.
fn add_relative(matrix: &mut DMatrix<f64>, a: usize, b: usize, information: &Mat6) {
    for (row, column, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
        let mut block = matrix.fixed_view_mut::<6, 6>(6 * row, 6 * column);
        block += information * sign;
    }
}

/// From motions of the object frame to those of the scans' frames.
fn to_scan_frames(matrix: &mut DMatrix<f64>, object_from_scan: &[Mat6]) {
    for (r, left) in object_from_scan.iter().enumerate() {
        for (c, right) in object_from_scan.iter().enumerate() {
            let block = left.transpose() * matrix.fixed_view::<6, 6>(6 * r, 6 * c) * right;
            matrix.fixed_view_mut::<6, 6>(6 * r, 6 * c).copy_from(&block);
        }
    }
}

/// Standard errors of the l_i of (2).
struct StandardErrors<'a> {
    patches: &'a [&'a [PatchView]],
    /// Only every `stride`-th patch is evaluated.
    stride: usize,
    /// The share of the patches that are independent.
    independent_share: f64,
}

impl StandardErrors<'_> {
    fn new<'a>(
        patches: &'a [&'a [PatchView]],
        directions: usize,
        independent_share: f64,
    ) -> StandardErrors<'a> {
        let products: usize = patches.iter().map(|p| p.len() * (p.len() - 1) / 2).sum();
        let stride = (products * directions).div_ceil(MAX_PRODUCTS).max(1);
        StandardErrors { patches, stride, independent_share }
    }

    /// The standard error of the estimate along `motion` of all scans' object frames.
    fn along(&self, motion: &DVector<f64>) -> f64 {
        let squares =
            self.patches.iter().step_by(self.stride).map(|patch| product(patch, motion).powi(2));
        (squares.sum::<f64>() * self.stride as f64 / self.independent_share).sqrt()
    }
}

/// The part of one patch in xi^T X xi of (1).
fn product(patch: &[PatchView], motion: &DVector<f64>) -> f64 {
    view_pairs(patch)
        .map(|ViewPair { a, b, weight }| {
            let relative: Twist =
                motion.fixed_rows::<6>(6 * a.scan) - motion.fixed_rows::<6>(6 * b.scan);
            weight * a.own.dot(&relative) * b.own.dot(&relative) // (1)
        })
        .sum()
}

/// f of (3) from an estimate l with its standard error, where neighbours share `rho` of their
/// noise.
fn shrinkage_factor(estimate: f64, error: f64, rho: f64) -> f64 {
    let bound = SIGNIFICANCE_SIGMA * error;
    let significant =
        if estimate > bound { estimate * (1.0 - (bound / estimate).powi(2)) } else { 0.0 };
    let significant = significant.min(1.0);
    significant + (1.0 - significant) * rho // (3)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// One scan's normal of a patch, and that of both scans.
    struct PatchNormals {
        surfel: u32,
        scan: usize,
        center: Vec3,
        own: Vec3,
        shared: Vec3,
    }

    /// Two scans of a plate z = 0 of 20 x 20 patches; their own normals are tilted by chance, and
    /// those of the first scan at one border by `edge` besides.
    fn plate(tilt: f64, edge: f64) -> Vec<PatchNormals> {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut seen = Vec::new();
        for surfel in 0..400_u32 {
            let center =
                Vec3::new(f64::from(surfel % 20) - 9.5, f64::from(surfel / 20) - 9.5, 0.0) * 4e-3;
            let own = [0, 1].map(|scan| {
                let [x, y]: [f64; 2] =
                    [(); 2].map(|()| tilt * rng.sample::<f64, _>(StandardNormal));
                // What one scan alone sees of another face beyond the edge.
                let beyond = if scan == 0 && surfel % 20 == 0 { edge } else { 0.0 };
                Vec3::new(x + beyond, y, 1.0).normalize()
            });
            let shared = (own[0] + own[1]).normalize();
            seen.extend(own.iter().enumerate().map(|(scan, &own)| PatchNormals {
                surfel,
                scan,
                center,
                own,
                shared,
            }));
        }
        seen
    }

    /// Adds the slope 0.3 along x to a normal.
    fn folded(normal: &Vec3) -> Vec3 {
        Vec3::new(normal.x + 0.3, normal.y, normal.z).normalize()
    }

    fn prior() -> Mat6 {
        Mat6::from_diagonal(&Twist::new(4e6, 4e6, 4e6, 1e6, 1e6, 1e6))
    }

    /// Variances of the two scans' relative pose (x y z rx ry rz) for an information on both poses
    /// besides the priors, in units of the prior's.
    fn relative_variances(mut information: DMatrix<f64>) -> Twist {
        for k in 0..2 {
            let mut block = information.fixed_view_mut::<6, 6>(6 * k, 6 * k);
            block += prior();
        }
        let c = information.try_inverse().unwrap();
        Twist::from_fn(|i, _| {
            let relative = c[(i, i)] + c[(i + 6, i + 6)] - 2.0 * c[(i, i + 6)];
            relative * prior()[(i, i)] / 2.0
        })
    }

    /// Relative variances that the shrunk information leaves, and those that would be left if all
    /// squares of the normals were information.
    fn variances_left(seen: &[PatchNormals]) -> (Twist, Twist) {
        let views: Vec<PatchView> = seen
            .iter()
            .map(|s| PatchView {
                surfel: s.surfel,
                scan: s.scan,
                weight: 1e10,
                own: height_derivative(&s.own, &s.center),
                shared: height_derivative(&s.shared, &s.center),
            })
            .collect();
        let poses = [Pose::identity(), Pose::identity()];
        let noise = SharedNoise { height_share: 0.0, independent_normals: 0.2 };
        let shrinkage = InformationShrinkage::new(&views, &poses, &prior(), noise).unwrap();
        let patches: Vec<&[PatchView]> = views.chunk_by(|a, b| a.surfel == b.surfel).collect();
        let (hessian, _) = information_sums(&patches, 2);
        (relative_variances(shrinkage.information(&hessian)), relative_variances(hessian))
    }

    #[test]
    fn normals_tilted_by_chance_or_in_one_scan_alone_do_not_determine_a_slide() {
        for (tilt, edge) in [(0.05, 0.0), (0.02, 0.3)] {
            let (shrunk, unshrunk) = variances_left(&plate(tilt, edge));
            assert!(unshrunk[0] < 0.01, "{unshrunk}");
            for slide in [0, 1, 5] {
                assert!(shrunk[slide] > 0.8, "{slide}: {shrunk}");
            }
            for determined in [2, 3, 4] {
                assert!(shrunk[determined] < 0.1, "{determined}: {shrunk}");
            }
        }
    }

    #[test]
    fn a_fold_that_both_scans_see_determines_a_slide_across_it() {
        let mut seen = plate(0.02, 0.0);
        for s in seen.iter_mut().filter(|s| s.center.x > 0.0) {
            (s.own, s.shared) = (folded(&s.own), folded(&s.shared));
        }
        let (shrunk, _) = variances_left(&seen);
        assert!(shrunk[0] < 0.01, "{shrunk}");
        assert!(shrunk[1] > 0.9, "{shrunk}");
    }

    #[test]
    fn an_estimate_that_hardly_exceeds_its_error_counts_little() {
        assert_eq!(shrinkage_factor(0.1, 0.05, 0.0), 0.0);
        assert!(shrinkage_factor(0.1, 0.049, 0.0) < 0.005);
        assert!((shrinkage_factor(0.6, 0.03, 0.0) - 0.6 * 0.99).abs() < 1e-12);
        assert_eq!(shrinkage_factor(1.2, 0.01, 0.0), 1.0);
        assert_eq!(shrinkage_factor(0.0, 0.05, 0.7), 0.7);
    }

    #[test]
    fn the_height_derivative_agrees_with_finite_differences() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let [normal, position] =
            [(); 2].map(|()| Vec3::from_fn(|_, _| rng.random_range(-1.0..1.0)));
        let normal = normal.normalize();
        let derivative = height_derivative(&normal, &position);
        for k in 0..6 {
            let step = Twist::from_fn(|i, _| if i == k { 1e-6 } else { 0.0 });
            let moved = crate::geometry::exp(&step).transform_point(&position.into()).coords;
            assert!((normal.dot(&(moved - position)) / 1e-6 - derivative[k]).abs() < 1e-5);
        }
    }
}
