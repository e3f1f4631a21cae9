//! Whether each vertex's standard deviation says how wrong it is.
//!
//! The error of an observed vertex is its signed distance to the truth, positive outside, after one
//! rigid fit of all observed vertices. That fit takes away a part of every error, so sigma is taken
//! conditional on it. With independent errors of covariance Sigma and the hat matrix of the fit
//!
//! P = J (J^T J)^-1 J^T,                             (1)
//!
//! the covariance of the residuals is
//!
//! (I - P) Sigma (I - P)^T.                          (2)

use super::distances::MM_PER_M;
use super::reference_surface::{NearestPoint, ReferenceSurface};
use super::statistics::{mean, rank_correlation};
use super::surface_icp::{NormalizedFrame, align_to_surface};
use crate::geometry::{Mat6, Pose, Twist, Vec3, transform};
use crate::mesh::Mesh;
use crate::{Progress, Result};
use serde::Serialize;

/// Fewer observed vertices than this give no shares worth telling.
const MIN_VERTICES: usize = 10;
/// Eigenvalues of the fit's Hessian below this share of its largest diagonal element are directions
/// that the surface does not constrain.
const MIN_EIGENVALUE_RATIO: f64 = 1e-6;

/// How well the standard deviations of a mesh's vertices match their errors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SigmaCalibration {
    /// Share of the observed vertices whose error is at most sigma (0.683 if errors are normal).
    pub within_1_sigma: f64,
    /// Share of the observed vertices whose error is at most 2 sigma (0.954 if errors are normal).
    pub within_2_sigma: f64,
    /// Spearman's correlation of sigma and the size of the error, -1..1.
    pub sigma_rank_correlation: f64,
    /// Mean signed error, positive outside, mm.
    pub error_bias: f64,
    /// Mean sigma, mm.
    pub sigma_mean: f64,
    /// Observed vertices with a sigma.
    pub calibration_vertices: usize,
}

/// Compares the sigma of the vertices of `mesh` with their errors against `truth` (same frame,
/// metres).
///
/// Returns `None` if fewer than 10 observed vertices have a sigma. In a mesh without `observed`
/// flags all vertices with a positive, finite sigma count as observed.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn assess_sigma(
    mesh: &Mesh,
    truth: &ReferenceSurface,
    progress: &Progress,
) -> Result<Option<SigmaCalibration>> {
    let chosen: Vec<usize> = (0..mesh.sigma.len()).filter(|&i| has_sigma(mesh, i)).collect();
    if chosen.len() < MIN_VERTICES {
        return Ok(None);
    }
    let points: Vec<Vec3> = chosen.iter().map(|&i| mesh.vertices[i]).collect();
    let pose = align_to_surface(&points, truth, progress)?.pose;
    let moved: Vec<Vec3> = points.iter().map(|p| transform(&pose, p)).collect();
    let nearest = truth.nearest_all(&moved);
    let sigma: Vec<f64> = chosen.iter().map(|&i| mesh.sigma[i]).collect();
    let sigma = conditional_sigma(&moved, &nearest, &sigma);
    let error: Vec<f64> = moved
        .iter()
        .zip(&nearest)
        .map(|(p, n)| n.distance.copysign(n.normal.dot(&(p - n.point))))
        .collect();
    let size: Vec<f64> = error.iter().map(|e| e.abs()).collect();
    Ok(Some(SigmaCalibration {
        within_1_sigma: share_within(1.0, &error, &sigma),
        within_2_sigma: share_within(2.0, &error, &sigma),
        sigma_rank_correlation: rank_correlation(&sigma, &size),
        error_bias: MM_PER_M * mean(&error),
        sigma_mean: MM_PER_M * mean(&sigma),
        calibration_vertices: error.len(),
    }))
}

/// Whether `vertex` is observed and has a positive, finite standard deviation.
fn has_sigma(mesh: &Mesh, vertex: usize) -> bool {
    mesh.observed.get(vertex).copied().unwrap_or(true)
        && mesh.sigma[vertex].is_finite()
        && mesh.sigma[vertex] > 0.0
}

/// Share of the errors that are at most `factor` times their sigma.
fn share_within(factor: f64, errors: &[f64], sigma: &[f64]) -> f64 {
    let inside = errors.iter().zip(sigma).filter(|(e, s)| e.abs() <= factor * **s).count();
    inside as f64 / errors.len() as f64
}

/// Standard deviations of the residuals that a rigid fit leaves of independent errors with standard
/// deviations `sigma`.
fn conditional_sigma(points: &[Vec3], nearest: &[NearestPoint], sigma: &[f64]) -> Vec<f64> {
    let Some(frame) = NormalizedFrame::new(points, &Pose::identity()) else {
        return sigma.to_vec();
    };
    let jacobians: Vec<Twist> =
        points.iter().zip(nearest).map(|(p, n)| frame.jacobian(p, &n.normal)).collect();
    let (mut hessian, mut spread) = (Mat6::zeros(), Mat6::zeros());
    for (j, s) in jacobians.iter().zip(sigma) {
        let outer = j * j.transpose();
        hessian += outer;
        spread += outer * (s * s);
    }
    // Directions that the surface does not constrain are not fitted.
    let Ok(inverse) = hessian.pseudo_inverse(MIN_EIGENVALUE_RATIO * hessian.diagonal().max())
    else {
        return sigma.to_vec();
    };
    let middle = inverse * spread * inverse;
    let pairs = jacobians.iter().zip(sigma);
    pairs
        .map(|(j, s)| {
            let leverage = j.dot(&(inverse * j)); // (1), diagonal
            (s * s * (1.0 - 2.0 * leverage) + j.dot(&(middle * j))).max(0.0).sqrt() // (2), diagonal
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_shapes::{cuboid, sphere};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// A sphere whose vertices err along the normal by `scale` times their sigma.
    fn noisy(scale: f64) -> Mesh {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut mesh = sphere(0.1, 5);
        for i in 0..mesh.vertices.len() {
            let sigma = if mesh.vertices[i].z > 0.0 { 1e-4 } else { 3e-4 };
            let noise: f64 = StandardNormal.sample(&mut rng);
            let normal = mesh.vertices[i].normalize();
            mesh.vertices[i] += normal * (noise * sigma * scale);
            mesh.sigma.push(sigma);
            mesh.observed.push(true);
        }
        mesh
    }

    fn measure(mesh: &Mesh) -> Option<SigmaCalibration> {
        let truth = ReferenceSurface::new(&sphere(0.1, 5)).unwrap();
        assess_sigma(mesh, &truth, &Progress::silent()).unwrap()
    }

    #[test]
    fn normal_errors_of_the_stated_size_give_the_normal_shares() {
        let found = measure(&noisy(1.0)).unwrap();
        assert!((found.within_1_sigma - 0.683).abs() < 0.015, "{found:?}");
        assert!((found.within_2_sigma - 0.954).abs() < 0.01, "{found:?}");
        assert!(found.sigma_rank_correlation > 0.4);
        assert!((found.sigma_mean - 0.2).abs() < 0.005);
        assert_eq!(found.calibration_vertices, 10_242);
        assert!(measure(&noisy(2.0)).unwrap().within_1_sigma < 0.4);
    }

    #[test]
    fn vertices_that_were_not_observed_do_not_count() {
        let mut mesh = noisy(1.0);
        for i in 0..mesh.vertices.len() {
            if mesh.vertices[i].z > 0.0 {
                mesh.observed[i] = false;
                mesh.vertices[i] *= 1.5;
            }
        }
        let found = measure(&mesh).unwrap();
        assert!((found.within_1_sigma - 0.683).abs() < 0.02, "{found:?}");
        assert!(found.sigma_rank_correlation.abs() < 0.05, "{found:?}");
        mesh.sigma.clear();
        assert_eq!(measure(&mesh), None);
    }

    #[test]
    fn the_fit_takes_six_degrees_of_freedom_of_the_variance() {
        let mesh = cuboid(Vec3::zeros(), Vec3::new(0.1, 0.2, 0.3));
        let samples = super::super::sample_surface(&mesh, 30, 1, 0).unwrap();
        let points: Vec<Vec3> = samples.iter().map(|s| s.point).collect();
        let nearest = ReferenceSurface::new(&mesh).unwrap().nearest_all(&points);
        let left = conditional_sigma(&points, &nearest, &[2.0; 30]);
        let total: f64 = left.iter().map(|s| s * s / 4.0).sum();
        assert!((total - 24.0).abs() < 1e-9, "{total}");
    }
}
