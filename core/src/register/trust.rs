//! How far the joint optimisation may trust the normals, direction by direction of all poses
//! together. `evidence` asks the same of two scans.
//!
//! The gradient g of the geometry's half squared error has the variance H = J^T J by the noise of
//! the heights, but by a motion of the poses it does not change by H: noise of the normals, and
//! what tilts those of some scans at edges that others do not see, adds squares to H in directions
//! that the surface leaves open. Growing is such a direction: opposite faces are in no scan
//! together. Products of two scans' *own* normals are free of that. With a_k the derivative of a
//! patch's height by a motion of the object frame, along the own mean normal of scan k, a along
//! that of all, w_k its weight there, and d = xi_k - xi_l,
//!
//! ```text
//! xi^T X xi = sum_s sum_k<l w_k w_l / sum w (a_k . d) (a_l . d)
//! xi^T H xi = sum_s sum_k<l w_k w_l / sum w (a . d)^2                                    (1)
//! ```
//!
//! X has the expectation that noise-free normals give. Of a gradient with slope X and variance H
//! the best linear use is X H^-1 g, which has the information X H^-1 X (optimal estimating
//! function; Godambe & Heyde 1987, Quasi-likelihood and Optimal Estimation). With
//!
//! ```text
//! X v_i = l_i H v_i,   v_i^T H v_j = delta_ij                                            (2)
//! ```
//!
//! that is a geometry that counts by l_i in the direction v_i of the gradient, and by l_i^2 for the
//! covariance. The prior does the rest. l_i is an estimate, the sum of the patches' products, with
//! a standard error e_i by the squares of these products (White 1980, A
//! Heteroskedasticity-Consistent Covariance Matrix Estimator) and by the share of patches that are
//! independent. It is shrunk by what it cannot be told from zero (positive-part shrinkage; James &
//! Stein 1961),
//!
//! ```text
//! s_i = l_i (1 - (2 e_i / l_i)^2)  if l_i > 2 e_i, else 0;     s_i + rho (1 - s_i)     (3)
//! ```
//!
//! so that there is no threshold to fall off. Where neighbours share the part rho of their noise,
//! much of what is known lies in their differences (`whiten`), which (1) does not see: that part is
//! trusted as it is.

use crate::geometry::{Mat6, Pose, Twist, Vec3, adjoint};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;

/// Standard errors that the information on a direction must stand out of zero, as in `evidence`.
const SIGNIFICANT: f64 = 2.0;
/// H holds this share of the prior besides, so that directions in which the geometry says nothing
/// at all have a length.
const PRIOR_SHARE: f64 = 0.01;
/// Products of two scans' normals that the standard errors are taken from, at most: of twenty-six
/// dense laser scans every fifth patch or so, so that they take no time beside the equations.
const MAX_PRODUCTS: usize = 5_000_000;

/// What the noise of neighbouring patches has in common.
#[derive(Clone, Copy)]
pub(super) struct SharedNoise {
    /// The share of their heights' variance, rho.
    pub rho: f64,
    /// The share of patches in which the errors of the normals are independent.
    pub independent: f64,
}

/// What one scan saw of one patch of the surface.
pub(super) struct Seen {
    /// The patch and the scan.
    pub surfel: u32,
    pub scan: usize,
    /// Inverse variance of its height, 1 / square metres.
    pub weight: f64,
    /// Middle of the patch, object frame, metres.
    pub center: Vec3,
    /// Mean normals of the scan's own points and of all scans', object frame.
    pub own: Vec3,
    pub shared: Vec3,
}

/// Derivatives of a patch's height by a motion of the object frame, for one scan that saw it.
struct Slope {
    scan: usize,
    weight: f64,
    own: Twist,
    shared: Twist,
}

/// How far the geometry is trusted.
pub(super) struct Trust {
    /// H = L L^T, and the inverse of L.
    lower: DMatrix<f64>,
    inverse: DMatrix<f64>,
    /// Columns: L^T v_i.
    directions: DMatrix<f64>,
    /// (3) of each.
    shares: Vec<f64>,
}

impl Trust {
    /// Of what scans at `poses` saw, patch by patch, each scan with the same `prior` information.
    /// `None` if the prior is infinite or not a number.
    pub(super) fn new(
        seen: &[Seen],
        poses: &[Pose],
        prior: &Mat6,
        noise: SharedNoise,
    ) -> Option<Trust> {
        let of_patch = |seen: &[Seen]| seen.iter().map(Slope::of).collect();
        let patches: Vec<Vec<Slope>> =
            seen.chunk_by(|a, b| a.surfel == b.surfel).map(of_patch).collect();
        let object_from_scan: Vec<Mat6> = poses.iter().map(adjoint).collect();
        let (mut all, mut cross) = sums(&patches, poses.len());
        in_scans(&mut all, &object_from_scan);
        in_scans(&mut cross, &object_from_scan);
        for k in 0..poses.len() {
            let mut block = all.fixed_view_mut::<6, 6>(6 * k, 6 * k);
            block += prior * PRIOR_SHARE;
        }
        let lower = all.cholesky()?.l();
        let inverse =
            lower.solve_lower_triangular(&DMatrix::identity(lower.nrows(), lower.ncols()))?;
        let relative = &inverse * cross * inverse.transpose();
        // Rounding leaves it symmetric to 1e-16 only.
        let eigen = SymmetricEigen::new((&relative + relative.transpose()) * 0.5);
        // v_i as motions of the object frame.
        let mut motions = inverse.transpose() * &eigen.eigenvectors;
        for (k, moves) in object_from_scan.iter().enumerate() {
            let rows = moves * motions.fixed_rows::<6>(6 * k);
            motions.fixed_rows_mut::<6>(6 * k).copy_from(&rows);
        }
        let errors = Errors::new(&patches, motions.ncols(), noise.independent);
        let of_direction = |i: usize| {
            share(eigen.eigenvalues[i], errors.of(&motions.column(i).into_owned()), noise.rho)
        };
        let shares = (0..motions.ncols()).into_par_iter().map(of_direction).collect();
        Some(Trust { lower, inverse, directions: eigen.eigenvectors, shares })
    }

    /// The part of the geometry's gradient that is trusted.
    pub(super) fn gradient(&self, gradient: &DVector<f64>) -> DVector<f64> {
        self.scaled(|share| share) * gradient
    }

    /// The information that the trusted gradient has; `hessian` is the geometry's.
    pub(super) fn information(&self, hessian: &DMatrix<f64>) -> DMatrix<f64> {
        let scaled = self.scaled(|share| share);
        &scaled * hessian * scaled.transpose()
    }

    /// By how much the trusted gradient changes at most: Newton steps by it converge, also where
    /// more is known than it seems.
    pub(super) fn stiffness(&self, hessian: &DMatrix<f64>) -> DMatrix<f64> {
        let scaled = self.scaled(f64::sqrt);
        &scaled * hessian * scaled.transpose()
    }

    /// `H V diag(of(shares)) V^T`.
    fn scaled(&self, of: impl Fn(f64) -> f64) -> DMatrix<f64> {
        let mut scaled = self.directions.clone();
        for (mut column, share) in scaled.column_iter_mut().zip(&self.shares) {
            column *= of(*share);
        }
        &self.lower * (scaled * self.directions.transpose()) * &self.inverse
    }
}

impl Slope {
    fn of(seen: &Seen) -> Slope {
        Slope {
            scan: seen.scan,
            weight: seen.weight,
            own: along(&seen.own, &seen.center),
            shared: along(&seen.shared, &seen.center),
        }
    }
}

/// Derivative of the height along `normal` of the point `at` by a motion of its frame.
fn along(normal: &Vec3, at: &Vec3) -> Twist {
    let turn = at.cross(normal);
    Twist::new(normal.x, normal.y, normal.z, turn.x, turn.y, turn.z)
}

/// Pairs of a patch's scans with the weights of (1).
fn pairs(patch: &[Slope]) -> impl Iterator<Item = (&Slope, &Slope, f64)> {
    let total: f64 = patch.iter().map(|slope| slope.weight).sum();
    patch.iter().enumerate().flat_map(move |(i, a)| {
        patch[i + 1..].iter().map(move |b| (a, b, a.weight * b.weight / total))
    })
}

/// H and X of (1) by motions of the object frame.
fn sums(patches: &[Vec<Slope>], scans: usize) -> (DMatrix<f64>, DMatrix<f64>) {
    let zeros = DMatrix::zeros(6 * scans, 6 * scans);
    let (mut all, mut cross) = (zeros.clone(), zeros);
    for (a, b, weight) in patches.iter().flat_map(|patch| pairs(patch)) {
        let product = a.own * b.own.transpose() * (0.5 * weight);
        add(&mut cross, a.scan, b.scan, &(product + product.transpose()));
        add(&mut all, a.scan, b.scan, &(a.shared * b.shared.transpose() * weight));
    }
    (all, cross)
}

/// Adds what is known of the difference of two scans' motions.
fn add(matrix: &mut DMatrix<f64>, a: usize, b: usize, block: &Mat6) {
    for (row, column, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
        let mut at = matrix.fixed_view_mut::<6, 6>(6 * row, 6 * column);
        at += block * sign;
    }
}

/// From motions of the object frame to those of the scans' frames.
fn in_scans(matrix: &mut DMatrix<f64>, object_from_scan: &[Mat6]) {
    for (r, left) in object_from_scan.iter().enumerate() {
        for (c, right) in object_from_scan.iter().enumerate() {
            let block = left.transpose() * matrix.fixed_view::<6, 6>(6 * r, 6 * c) * right;
            matrix.fixed_view_mut::<6, 6>(6 * r, 6 * c).copy_from(&block);
        }
    }
}

/// Standard errors of the l_i of (2).
struct Errors<'a> {
    patches: &'a [Vec<Slope>],
    /// Every so many of the patches.
    stride: usize,
    independent: f64,
}

impl Errors<'_> {
    fn new(patches: &[Vec<Slope>], directions: usize, independent: f64) -> Errors<'_> {
        let products: usize = patches.iter().map(|p| p.len() * (p.len() - 1) / 2).sum();
        let stride = (products * directions).div_ceil(MAX_PRODUCTS).max(1);
        Errors { patches, stride, independent }
    }

    /// Of the direction `motion`.
    fn of(&self, motion: &DVector<f64>) -> f64 {
        let product = |patch: &Vec<Slope>| -> f64 {
            let of_pair = |(a, b, weight): (&Slope, &Slope, f64)| {
                let of = |slope: &Slope| motion.fixed_rows::<6>(6 * slope.scan);
                let apart: Twist = of(a) - of(b);
                weight * a.own.dot(&apart) * b.own.dot(&apart)
            };
            pairs(patch).map(of_pair).sum()
        };
        let squares = self.patches.iter().step_by(self.stride).map(|patch| product(patch).powi(2));
        (squares.sum::<f64>() * self.stride as f64 / self.independent).sqrt()
    }
}

/// (3) of an estimate with its standard error, where neighbours share `rho` of their noise.
fn share(estimate: f64, error: f64, rho: f64) -> f64 {
    let bound = SIGNIFICANT * error;
    let proven = if estimate > bound { estimate * (1.0 - (bound / estimate).powi(2)) } else { 0.0 };
    let proven = proven.min(1.0);
    proven + (1.0 - proven) * rho
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// Two scans of a plate z = 0 of 20 x 20 patches; their own normals are tilted by chance, and
    /// those of the first scan at one border by `edge` besides.
    fn plate(tilt: f64, edge: f64) -> Vec<Seen> {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut seen = Vec::new();
        for i in 0..400_u32 {
            let center = Vec3::new(f64::from(i % 20) - 9.5, f64::from(i / 20) - 9.5, 0.0) * 4e-3;
            let mut own = |scan: usize| {
                let mut noise = || tilt * rng.sample::<f64, _>(StandardNormal);
                // What one scan alone sees of another face beyond the edge.
                let beyond = if scan == 0 && i % 20 == 0 { edge } else { 0.0 };
                Vec3::new(noise() + beyond, noise(), 1.0).normalize()
            };
            let both = [own(0), own(1)];
            let shared = (both[0] + both[1]).normalize();
            seen.extend(both.iter().enumerate().map(|(scan, own)| Seen {
                surfel: i,
                scan,
                weight: 1e10,
                center,
                own: *own,
                shared,
            }));
        }
        seen
    }

    /// Variances of the scans' relative pose (x y z rx ry rz), in units of the prior's: what is
    /// trusted leaves, and what would be left if all squares of the normals were knowledge.
    fn left(seen: &[Seen]) -> (Twist, Twist) {
        let poses = [Pose::identity(), Pose::identity()];
        let prior = Mat6::from_diagonal(&Twist::new(4e6, 4e6, 4e6, 1e6, 1e6, 1e6));
        let trust =
            Trust::new(seen, &poses, &prior, SharedNoise { rho: 0.0, independent: 0.2 }).unwrap();
        let patches: Vec<Vec<Slope>> = seen
            .chunk_by(|a, b| a.surfel == b.surfel)
            .map(|patch| patch.iter().map(Slope::of).collect())
            .collect();
        let (all, _) = sums(&patches, 2);
        let variances = |mut information: DMatrix<f64>| {
            for k in 0..2 {
                let mut block = information.fixed_view_mut::<6, 6>(6 * k, 6 * k);
                block += prior;
            }
            let c = information.try_inverse().unwrap();
            Twist::from_fn(|i, _| {
                let apart = c[(i, i)] + c[(i + 6, i + 6)] - 2.0 * c[(i, i + 6)];
                apart * prior[(i, i)] / 2.0
            })
        };
        (variances(trust.information(&all)), variances(all))
    }

    #[test]
    fn normals_tilted_by_chance_or_in_one_scan_alone_tell_nothing_of_a_slide() {
        for (tilt, edge) in [(0.05, 0.0), (0.02, 0.3)] {
            let (trusted, pretended) = left(&plate(tilt, edge));
            assert!(pretended[0] < 0.01, "{pretended}");
            for slide in [0, 1, 5] {
                assert!(trusted[slide] > 0.8, "{slide}: {trusted}");
            }
            for held in [2, 3, 4] {
                assert!(trusted[held] < 0.1, "{held}: {trusted}");
            }
        }
    }

    #[test]
    fn a_fold_that_both_scans_see_holds_them() {
        let mut seen = plate(0.02, 0.0);
        for s in seen.iter_mut().filter(|s| s.center.x > 0.0) {
            let fold = |n: &Vec3| Vec3::new(n.x + 0.3, n.y, n.z).normalize();
            (s.own, s.shared) = (fold(&s.own), fold(&s.shared));
        }
        let (trusted, _) = left(&seen);
        assert!(trusted[0] < 0.01, "{trusted}");
        assert!(trusted[1] > 0.9, "{trusted}");
    }

    #[test]
    fn what_stands_out_by_little_counts_for_little() {
        assert_eq!(share(0.1, 0.05, 0.0), 0.0);
        assert!(share(0.1, 0.049, 0.0) < 0.005);
        assert!((share(0.6, 0.03, 0.0) - 0.6 * 0.99).abs() < 1e-12);
        assert_eq!(share(1.2, 0.01, 0.0), 1.0);
        assert_eq!(share(0.0, 0.05, 0.7), 0.7);
    }

    #[test]
    fn the_derivative_is_that_of_the_height() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut vector = || Vec3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let (normal, at) = (vector().normalize(), vector());
        let slope = along(&normal, &at);
        for k in 0..6 {
            let step = Twist::from_fn(|i, _| if i == k { 1e-6 } else { 0.0 });
            let moved = crate::geometry::exp(&step).transform_point(&at.into()).coords;
            assert!((normal.dot(&(moved - at)) / 1e-6 - slope[k]).abs() < 1e-5);
        }
    }
}
