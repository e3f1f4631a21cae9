//! Errors of registered poses.
//!
//! The errors are measured with noise-free hits, so that they do not contain the sensor's own
//! noise: they are the distances between where the estimated and the true pose put a point of the
//! surface.

use super::distances::MM_PER_M;
use super::reference_surface::ReferenceSurface;
use super::statistics::{quantile, rms};
use super::surface_icp::align_to_surface;
use crate::geometry::{Pose, Vec3, rigid_fit, transform};
use crate::mesh::Mesh;
use crate::{Error, Progress, Result};
use rayon::prelude::*;

/// The hits of one view and its two poses.
#[derive(Clone, Debug)]
pub struct PosedHits {
    /// Noise-free hits, true sensor frame, metres.
    pub hits: Vec<Vec3>,
    /// The true `object_from_sensor`.
    pub truth: Pose,
    /// The estimated `object_from_sensor`.
    pub estimate: Pose,
}

/// Errors of a set of poses, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseErrors {
    /// Root mean square distance between where the estimated and the true poses put the hits, after
    /// one common rigid fit.
    pub full: f64,
    /// Root mean square component of these differences along the true normals.
    pub normal: f64,
    /// Root mean square distance of the nearest 95 % of the hits, placed by the estimated poses, to
    /// the true surface after one robust rigid fit to it.
    pub surface: f64,
}

/// Share of the surface distances that counts; the rest belongs to views at grossly wrong poses.
const NEAREST_RATIO: f64 = 0.95;
/// Rounds of the robust fit to the surface; each omits the farthest points of the round before.
const TRIM_ROUNDS: usize = 2;

/// Measures the estimated poses of `views` of the closed surface `truth` (metres, object frame).
///
/// # Errors
/// [`Error::Input`] if there are fewer than three hits or the truth has no triangle;
/// [`Error::Cancelled`].
pub fn pose_errors(views: &[PosedHits], truth: &Mesh, progress: &Progress) -> Result<PoseErrors> {
    let reference = ReferenceSurface::new(truth)?;
    let true_hits = place_hits(views, |v| &v.truth);
    let estimated_hits = place_hits(views, |v| &v.estimate);
    let fit = rigid_fit(&estimated_hits, &true_hits).ok_or_else(|| {
        let count = estimated_hits.len();
        Error::input(format!("{count} hits: at least three are needed to compare poses"))
    })?;
    let errors: Vec<(f64, f64)> = estimated_hits
        .par_iter()
        .zip(&true_hits)
        .map(|(a, b)| {
            let error = transform(&fit, a) - b;
            (error.norm(), error.dot(&reference.nearest(b).normal))
        })
        .collect();
    let (full, normal): (Vec<f64>, Vec<f64>) = errors.into_iter().unzip();
    let surface = surface_error(&estimated_hits, &fit, &reference, progress)?;
    Ok(PoseErrors {
        full: rms(&full) * MM_PER_M,
        normal: rms(&normal) * MM_PER_M,
        surface: surface * MM_PER_M,
    })
}

/// The hits of all views in the object frame, placed by one pose of each view.
fn place_hits(views: &[PosedHits], pose: fn(&PosedHits) -> &Pose) -> Vec<Vec3> {
    views.iter().flat_map(|v| v.hits.iter().map(move |h| transform(pose(v), h))).collect()
}

/// Error of the alignment of one view to another, mm: the root mean square distance between where
/// the pose `fixed_from_moving` and the true poses put the hits of `moving`.
pub fn pair_error(moving: &PosedHits, fixed: &PosedHits, fixed_from_moving: &Pose) -> f64 {
    let truth = fixed.truth.inverse() * moving.truth;
    let hits = moving.hits.iter();
    let errors: Vec<f64> = hits
        .map(|hit| (transform(fixed_from_moving, hit) - transform(&truth, hit)).norm())
        .collect();
    rms(&errors) * MM_PER_M
}

/// Root mean square distance of the nearest 95 % of the points to the surface, metres, after a
/// robust fit that starts at `start`.
fn surface_error(
    points: &[Vec3],
    start: &Pose,
    reference: &ReferenceSurface,
    progress: &Progress,
) -> Result<f64> {
    let mut moved: Vec<Vec3> = points.iter().map(|p| transform(start, p)).collect();
    let mut near = moved.clone();
    for _ in 0..TRIM_ROUNDS {
        let pose = align_to_surface(&near, reference, progress)?.pose;
        moved.iter_mut().for_each(|p| *p = transform(&pose, p));
        near = nearest_share(&moved, reference).into_iter().map(|i| moved[i]).collect();
    }
    let distances: Vec<f64> = near.par_iter().map(|p| reference.nearest(p).distance).collect();
    Ok(rms(&distances))
}

/// Indices of the points that are among the nearest 95 %.
fn nearest_share(points: &[Vec3], reference: &ReferenceSurface) -> Vec<usize> {
    let distances: Vec<f64> = points.par_iter().map(|p| reference.nearest(p).distance).collect();
    let limit = quantile(&distances, NEAREST_RATIO);
    (0..points.len()).filter(|&i| distances[i] <= limit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Twist, exp};
    use crate::mesh::test_shapes::cuboid;

    fn views(error: impl Fn(usize) -> Twist) -> (Vec<PosedHits>, Mesh) {
        let truth = cuboid(Vec3::zeros(), Vec3::new(0.1, 0.07, 0.05));
        let samples = crate::assess::sample_surface(&truth, 6000, 1, 0).unwrap();
        let views = samples.chunks(1000).enumerate().map(|(i, samples)| {
            let pose = exp(&Twist::new(0.1 * i as f64, 0.3, -0.2, 0.3 * i as f64, 0.1, 0.5));
            let hits = samples.iter().map(|s| transform(&pose.inverse(), &s.point)).collect();
            PosedHits { hits, truth: pose, estimate: exp(&error(i)) * pose }
        });
        (views.collect(), truth)
    }

    #[test]
    fn a_common_motion_is_no_error() {
        let (views, truth) = views(|_| Twist::new(0.002, -0.003, 0.001, 0.02, 0.01, -0.03));
        let errors = pose_errors(&views, &truth, &Progress::silent()).unwrap();
        assert!(errors.full < 1e-9 && errors.normal < 1e-9, "{errors:?}");
        assert!(errors.surface < 1e-4, "{errors:?}");
    }

    #[test]
    fn opposite_shifts_show_in_full_and_partly_along_the_normal() {
        let shifts = [1e-3, -1e-3];
        let (views, truth) = views(|i| Twist::new(shifts[i % 2], 0.0, 0.0, 0.0, 0.0, 0.0));
        let errors = pose_errors(&views, &truth, &Progress::silent()).unwrap();
        assert!((errors.full - 1.0).abs() < 0.05, "{errors:?}");
        // The sides across x have 22 % of the area.
        let expected = (0.07f64 * 0.05 / (0.07 * 0.05 + 0.1 * 0.05 + 0.1 * 0.07)).sqrt();
        assert!((errors.normal - expected).abs() < 0.1, "{errors:?}");
        assert!(errors.surface < errors.normal, "{errors:?}");
    }

    #[test]
    fn a_pair_is_as_far_off_as_its_pose() {
        let (views, _) = views(|_| Twist::zeros());
        let exact = views[1].truth.inverse() * views[0].truth;
        assert!(pair_error(&views[0], &views[1], &exact) < 1e-9);
        let off = exp(&Twist::new(0.003, 0.0, 0.004, 0.0, 0.0, 0.0)) * exact;
        assert!((pair_error(&views[0], &views[1], &off) - 5.0).abs() < 1e-9);
    }
}
