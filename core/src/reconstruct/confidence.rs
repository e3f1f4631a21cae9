//! The standard deviation of each vertex of the finished mesh (Wiedemann 2014, §3.5).

use super::attraction::{Measurements, Pull, PullFunction};
use crate::mesh::{HalfEdgeMesh, Mesh};

/// The mesh with normals and, from the points within about `width` (metres) of each vertex, its
/// standard deviation: NaN and not observed where nothing was measured.
pub(super) fn with_confidence(
    mesh: HalfEdgeMesh,
    measurements: &Measurements,
    pull: PullFunction,
    width: f64,
) -> Mesh {
    // Vertices that were removed leave no gaps in the finished mesh.
    let mut finished = mesh.into_mesh();
    finished.compute_normals();
    let pulls: Vec<Option<Pull>> = finished
        .vertices
        .iter()
        .zip(&finished.normals)
        .map(|(vertex, normal)| pull(measurements, vertex, normal, width))
        .map(|pull| pull.filter(|p| p.is_measured))
        .collect();
    // The displacement that is left is part of the error.
    finished.sigma = pulls
        .iter()
        .map(|pull| pull.as_ref().map_or(f64::NAN, |p| p.sigma.hypot(p.displacement.norm())))
        .collect();
    finished.observed = pulls.iter().map(Option::is_some).collect();
    finished
}
