//! Detailing (Wiedemann 2014, §2.4.3): the mesh moves to the measured points while its edges shrink.

use super::attract::{Measurements, Pull};
use super::guard::{edit_guarded, move_guarded};
use super::shape::{Smoothing, regularise, smooth, umbrella};
use super::{DetailMethod, ReconstructParams, Scale};
use crate::geometry::Vec3;
use crate::mesh::HalfEdgeMesh;
use crate::mesh::remesh::{coarsen, remesh, vertex_normals};
use crate::{Progress, Result};
use rayon::prelude::*;

/// Moves between two changes of the edges.
const MOVES: usize = 2;
/// Moves after the last change of the edges: the pull halves the distance left, or better, each time.
const LAST_MOVES: usize = 4;
/// First finding range of the thesis's detailing at least, in voxel edges.
const THESIS_START: f64 = 2.0;
/// Edge length, as a share of the finding range, for which remeshing splits what is longer than the range.
const SPLIT_SHARE: f64 = 0.75;

/// Brings `mesh` to the points, in `params.iterations` steps of the finding range
/// `l_f = l_m + (i_max - i)/i_max (l_0 - l_m)`.
pub(super) fn detail(
    mesh: &mut HalfEdgeMesh,
    measurements: &Measurements,
    scale: &Scale,
    params: &ReconstructParams,
    progress: &Progress,
) -> Result<()> {
    let last = params.iterations;
    let start_edge = match params.detail {
        DetailMethod::Implicit => scale.start_edge,
        // The inflated mesh stays up to half a voxel away from a voxel whose point may be at its far corner: with less
        // than the thesis's 2 l the first finding range would miss the points.
        DetailMethod::Thesis => scale.start_edge.max(THESIS_START * scale.voxel),
    };
    if params.detail == DetailMethod::Implicit {
        // The field's lattice is finer than the mesh needs to be.
        edit_guarded(mesh, |mesh, frozen| coarsen(mesh, start_edge, frozen));
    }
    for i in 0..=last {
        progress.report("detail", i as f64 / (last + 1) as f64)?;
        let share = if last == 0 { 0.0 } else { (last - i) as f64 / last as f64 };
        let range = scale.edge + share * (start_edge - scale.edge);
        match params.detail {
            DetailMethod::Implicit => {
                edit_guarded(mesh, |mesh, frozen| remesh(mesh, range, frozen))
            }
            // Ours: splits (of edges longer than the range, as in the thesis) go with collapses and flips. With splits
            // alone slivers pile up, and once rounding makes them cut each other splits are refused as a whole.
            DetailMethod::Thesis => {
                edit_guarded(mesh, |mesh, frozen| remesh(mesh, SPLIT_SHARE * range, frozen))
            }
        }
        for step in 0..if i == last { LAST_MOVES } else { MOVES } {
            let settling = i == last && step + 1 == LAST_MOVES;
            let targets = match params.detail {
                DetailMethod::Implicit => {
                    implicit_targets(mesh, measurements, range, scale, settling)
                }
                DetailMethod::Thesis => thesis_targets(mesh, measurements, range, params),
            };
            move_guarded(mesh, &targets);
        }
    }
    progress.report("detail", 1.0)
}

/// What the points say to each vertex.
pub(super) fn pulls(
    mesh: &HalfEdgeMesh,
    normals: &[Vec3],
    measurements: &Measurements,
    width: f64,
    method: DetailMethod,
) -> Vec<Option<Pull>> {
    (0..mesh.positions.len())
        .into_par_iter()
        .map(|v| measurements.pull(&mesh.positions[v], &normals[v], width, method))
        .collect()
}

/// Observed vertices go to the surface and spread evenly over it; unobserved ones form a membrane between them.
fn implicit_targets(
    mesh: &HalfEdgeMesh,
    measurements: &Measurements,
    range: f64,
    scale: &Scale,
    settling: bool,
) -> Vec<Vec3> {
    let normals = vertex_normals(mesh);
    let width = scale.width(range);
    let pulls = pulls(mesh, &normals, measurements, width, DetailMethod::Implicit);
    let spread = umbrella(mesh);
    let target = |v: usize| {
        let Some(pull) = &pulls[v] else { return mesh.positions[v] + spread[v] * 0.5 };
        let tangential = spread[v] - normals[v] * spread[v].dot(&normals[v]);
        let relaxed = if settling { Vec3::zeros() } else { tangential * 0.5 };
        mesh.positions[v] + limited(pull.displacement, 0.5 * range) + limited(relaxed, 0.3 * range)
    };
    (0..mesh.positions.len()).map(target).collect()
}

/// The thesis's three forces: attraction, smoothing, regularising.
fn thesis_targets(
    mesh: &HalfEdgeMesh,
    measurements: &Measurements,
    range: f64,
    params: &ReconstructParams,
) -> Vec<Vec3> {
    let normals = vertex_normals(mesh);
    let pulls = pulls(mesh, &normals, measurements, range, DetailMethod::Thesis);
    // Confidence falls with the variance, from 1 to 0 where nothing was measured (§2.4.6).
    let confidence: Vec<f64> = pulls
        .iter()
        .map(|p| p.as_ref().map_or(0.0, |p| 1.0 / (1.0 + (p.sigma / (0.25 * range)).powi(2))))
        .collect();
    let smoothing = Smoothing {
        strength: params.smoothing,
        angles: [params.smooth_angle_min, params.smooth_angle_max],
    };
    let smoothed = smooth(mesh, &normals, &confidence, &smoothing);
    let regular = regularise(mesh, params.regularising);
    let target = |v: usize| {
        let pull =
            pulls[v].as_ref().map_or_else(Vec3::zeros, |p| limited(p.displacement, 0.5 * range));
        mesh.positions[v]
            + pull
            + limited(smoothed[v], 0.3 * range)
            + limited(regular[v], 0.3 * range)
    };
    (0..mesh.positions.len()).map(target).collect()
}

/// `v`, shortened to `longest` (metres).
fn limited(v: Vec3, longest: f64) -> Vec3 {
    let length = v.norm();
    if length > longest { v * (longest / length) } else { v }
}
