//! Whether each vertex's standard deviation says how wrong it is.
//!
//! The error of an observed vertex is its signed distance to the truth, positive outside, after one rigid fit of all
//! observed vertices. That fit takes away part of every error, so sigma is taken conditional on it: with
//! independent errors and P = J (J^T J)^-1 J^T the residuals' covariance is (I - P) Sigma (I - P)^T.

use super::align::{Frame, align, apply};
use super::reference::{Nearest, Reference};
use super::stats::{mean, rank_correlation};
use crate::geometry::{Mat6, Vec3};
use crate::mesh::Mesh;
use crate::{Progress, Result};
use serde::Serialize;

/// How well the standard deviations of a mesh's vertices match their errors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Calibration {
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

/// Calibration of `mesh` against `truth`; `None` if fewer than 10 observed vertices have a sigma. A mesh that does
/// not say which vertices are observed is taken at its sigma's word.
///
/// # Errors
/// [`crate::Error::Cancelled`].
pub fn calibration(
    mesh: &Mesh,
    truth: &Reference,
    progress: &Progress,
) -> Result<Option<Calibration>> {
    let usable = |&i: &usize| {
        mesh.observed.get(i).copied().unwrap_or(true)
            && mesh.sigma[i].is_finite()
            && mesh.sigma[i] > 0.0
    };
    let chosen: Vec<usize> = (0..mesh.sigma.len()).filter(usable).collect();
    if chosen.len() < 10 {
        return Ok(None);
    }
    let points: Vec<Vec3> = chosen.iter().map(|&i| mesh.vertices[i]).collect();
    let pose = align(&points, truth, progress)?.pose;
    let moved: Vec<Vec3> = points.iter().map(|p| apply(&pose, p)).collect();
    let nearest = truth.nearest_all(&moved);
    let sigma: Vec<f64> = chosen.iter().map(|&i| mesh.sigma[i]).collect();
    let sigma = conditional_sigma(&moved, &nearest, &sigma);
    let error: Vec<f64> = moved
        .iter()
        .zip(&nearest)
        .map(|(p, n)| n.distance.copysign(n.normal.dot(&(p - n.point))))
        .collect();
    let within = |k: f64| {
        let inside = error.iter().zip(&sigma).filter(|(e, s)| e.abs() <= k * **s).count();
        inside as f64 / error.len() as f64
    };
    let size: Vec<f64> = error.iter().map(|e| e.abs()).collect();
    Ok(Some(Calibration {
        within_1_sigma: within(1.0),
        within_2_sigma: within(2.0),
        sigma_rank_correlation: rank_correlation(&sigma, &size),
        error_bias: 1000.0 * mean(&error),
        sigma_mean: 1000.0 * mean(&sigma),
        calibration_vertices: error.len(),
    }))
}

/// Standard deviations of what the fit leaves of independent errors with standard deviations `sigma`.
fn conditional_sigma(points: &[Vec3], nearest: &[Nearest], sigma: &[f64]) -> Vec<f64> {
    let Some(frame) = Frame::of(points, &crate::geometry::Pose::identity()) else {
        return sigma.to_vec();
    };
    let jacobian = |i: usize| frame.jacobian(&points[i], &nearest[i].normal);
    let (mut hessian, mut spread) = (Mat6::zeros(), Mat6::zeros());
    for (i, s) in sigma.iter().enumerate() {
        let outer = jacobian(i) * jacobian(i).transpose();
        hessian += outer;
        spread += outer * (s * s);
    }
    // Directions that the surface does not constrain are not fitted.
    let Ok(inverse) = hessian.pseudo_inverse(1e-6 * hessian.diagonal().max()) else {
        return sigma.to_vec();
    };
    let middle = inverse * spread * inverse;
    let remaining = |(i, s): (usize, &f64)| {
        let j = jacobian(i);
        let leverage = j.dot(&(inverse * j));
        (s * s * (1.0 - 2.0 * leverage) + j.dot(&(middle * j))).max(0.0).sqrt()
    };
    sigma.iter().enumerate().map(remaining).collect()
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

    fn measure(mesh: &Mesh) -> Option<Calibration> {
        let truth = Reference::new(&sphere(0.1, 5)).unwrap();
        calibration(mesh, &truth, &Progress::silent()).unwrap()
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
        let nearest = Reference::new(&mesh).unwrap().nearest_all(&points);
        let left = conditional_sigma(&points, &nearest, &[2.0; 30]);
        let total: f64 = left.iter().map(|s| s * s / 4.0).sum();
        assert!((total - 24.0).abs() < 1e-9, "{total}");
    }
}
