//! Detailing (Wiedemann 2014, §2.4.2): the mesh moves to the measured points while its edges
//! shrink.

use super::attraction::{Measurements, Pull, PullFunction};
use super::guard::{edit_guarded, move_guarded};
use super::params::{DetailMethod, ReconstructParams};
use super::scale::Scale;
use super::smoothing::{Smoothing, mean_neighbour_offsets, regularise, smooth};
use crate::geometry::Vec3;
use crate::mesh::HalfEdgeMesh;
use crate::mesh::remeshing::{coarsen, remesh, vertex_normals};
use crate::{Progress, Result};
use rayon::prelude::*;

/// Moves between two changes of the edges.
const STEP_MOVES: usize = 2;
/// Moves after the last change of the edges: the pull halves the distance left, or better, each
/// time.
const LAST_MOVES: usize = 4;
/// Least first finding range of the thesis's detailing, in voxel edges. The inflated mesh stays up
/// to half a voxel away from a voxel whose point may be at its far corner: within less than the
/// thesis's 2 l the first finding range would miss the points.
const THESIS_START_RATIO: f64 = 2.0;
/// Edge length, in finding ranges, for which remeshing splits what is longer than the range, as the
/// thesis does.
const THESIS_EDGE_RATIO: f64 = 0.75;
/// Share of the way to the mean of its neighbours that a vertex relaxes by in one move.
const RELAXATION_RATIO: f64 = 0.5;
/// Longest displacement by the points in one move, in finding ranges: half an edge keeps the order
/// of neighbouring vertices.
const MAX_PULL_RATIO: f64 = 0.5;
/// Longest displacement by smoothing, by regularising or along the surface in one move, in finding
/// ranges.
const MAX_SHAPING_RATIO: f64 = 0.3;
/// Standard deviation, in finding ranges, at which the confidence of a vertex is one half.
const HALF_CONFIDENCE_RATIO: f64 = 0.25;

/// How the mesh is detailed: the parameter [`DetailMethod`] and all that follows from it, resolved
/// once.
pub(super) struct DetailStrategy<'a> {
    /// What the points near a vertex say to it.
    pub pull: PullFunction,
    /// Finding range of the first step, metres.
    start_range: f64,
    /// Whether the inflated mesh is coarsened first, because it is finer than it needs to be.
    coarsens_first: bool,
    /// Edge length of remeshing, in finding ranges.
    edge_ratio: f64,
    /// Where the vertices of a step go.
    targets: fn(&DetailStrategy<'a>, &Step) -> Vec<Vec3>,
    measurements: &'a Measurements,
    scale: &'a Scale,
    params: &'a ReconstructParams,
}

/// The mesh before one move of its vertices.
struct Step<'a> {
    mesh: &'a HalfEdgeMesh,
    /// Finding range `l_f`, metres.
    range: f64,
    /// Whether it is the last move of all.
    is_last: bool,
}

impl<'a> DetailStrategy<'a> {
    pub(super) fn new(
        measurements: &'a Measurements,
        scale: &'a Scale,
        params: &'a ReconstructParams,
    ) -> DetailStrategy<'a> {
        match params.detail {
            DetailMethod::Implicit => DetailStrategy {
                pull: Measurements::implicit_pull,
                start_range: scale.start_edge,
                coarsens_first: true,
                edge_ratio: 1.0,
                targets: DetailStrategy::implicit_targets,
                measurements,
                scale,
                params,
            },
            // Ours: splits go with collapses and flips. With splits alone slivers pile up, and once
            // rounding makes them cut each other splits are refused as a whole.
            DetailMethod::Thesis => DetailStrategy {
                pull: Measurements::thesis_pull,
                start_range: scale.start_edge.max(THESIS_START_RATIO * scale.voxel),
                coarsens_first: false,
                edge_ratio: THESIS_EDGE_RATIO,
                targets: DetailStrategy::thesis_targets,
                measurements,
                scale,
                params,
            },
        }
    }

    /// Brings `mesh` to the points, in steps of the finding range:
    ///
    /// ```text
    /// l_f = l_m + (i_max - i) / i_max (l_0 - l_m)                                              (1)
    /// ```
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    pub(super) fn detail(&self, mesh: &mut HalfEdgeMesh, progress: &Progress) -> Result<()> {
        let last = self.params.iterations;
        if self.coarsens_first {
            edit_guarded(mesh, |mesh, frozen| coarsen(mesh, self.start_range, frozen));
        }
        for i in 0..=last {
            progress.report("detail", i as f64 / (last + 1) as f64)?;
            let share = if last == 0 { 0.0 } else { (last - i) as f64 / last as f64 };
            let range = self.scale.edge + share * (self.start_range - self.scale.edge); // (1)
            edit_guarded(mesh, |mesh, frozen| remesh(mesh, self.edge_ratio * range, frozen));
            let moves = if i == last { LAST_MOVES } else { STEP_MOVES };
            for k in 0..moves {
                let is_last = i == last && k + 1 == moves;
                let targets = (self.targets)(self, &Step { mesh, range, is_last });
                move_guarded(mesh, &targets);
            }
        }
        progress.report("detail", 1.0)
    }

    /// What the points within about `width` (metres) say to each vertex.
    fn pulls(&self, mesh: &HalfEdgeMesh, normals: &[Vec3], width: f64) -> Vec<Option<Pull>> {
        (0..mesh.positions.len())
            .into_par_iter()
            .map(|v| (self.pull)(self.measurements, &mesh.positions[v], &normals[v], width))
            .collect()
    }

    /// Observed vertices go to the surface and, but for the last move, spread evenly over it;
    /// unobserved ones form a membrane between them.
    fn implicit_targets(&self, step: &Step) -> Vec<Vec3> {
        let Step { mesh, range, is_last } = *step;
        let normals = vertex_normals(mesh);
        let pulls = self.pulls(mesh, &normals, self.scale.search_width(range));
        let offsets = mean_neighbour_offsets(mesh);
        let mut targets = Vec::with_capacity(pulls.len());
        for (v, pull) in pulls.iter().enumerate() {
            let Some(pull) = pull else {
                targets.push(mesh.positions[v] + offsets[v] * RELAXATION_RATIO);
                continue;
            };
            let tangential = offsets[v] - normals[v] * offsets[v].dot(&normals[v]);
            let relaxed = if is_last { Vec3::zeros() } else { tangential * RELAXATION_RATIO };
            targets.push(
                mesh.positions[v]
                    + limited(pull.displacement, MAX_PULL_RATIO * range)
                    + limited(relaxed, MAX_SHAPING_RATIO * range),
            );
        }
        targets
    }

    /// The three forces of the thesis: attraction, smoothing, regularising.
    fn thesis_targets(&self, step: &Step) -> Vec<Vec3> {
        let Step { mesh, range, .. } = *step;
        let normals = vertex_normals(mesh);
        let pulls = self.pulls(mesh, &normals, range);
        let confidence: Vec<f64> =
            pulls.iter().map(|pull| pull.as_ref().map_or(0.0, |p| confidence(p, range))).collect();
        let smoothing = Smoothing {
            strength: self.params.smoothing,
            angles: [self.params.smooth_angle_min, self.params.smooth_angle_max],
        };
        let smoothed = smooth(mesh, &normals, &confidence, &smoothing);
        let regularised = regularise(mesh, self.params.regularising);
        let mut targets = Vec::with_capacity(pulls.len());
        for (v, pull) in pulls.iter().enumerate() {
            let attracted = pull
                .as_ref()
                .map_or_else(Vec3::zeros, |p| limited(p.displacement, MAX_PULL_RATIO * range));
            targets.push(
                mesh.positions[v]
                    + attracted
                    + limited(smoothed[v], MAX_SHAPING_RATIO * range)
                    + limited(regularised[v], MAX_SHAPING_RATIO * range),
            );
        }
        targets
    }
}

/// The confidence of a vertex, which falls with the variance from 1 towards 0 (the thesis's `conf`,
/// §2.4.3, which it leaves open).
fn confidence(pull: &Pull, range: f64) -> f64 {
    1.0 / (1.0 + (pull.sigma / (HALF_CONFIDENCE_RATIO * range)).powi(2))
}

/// `v`, shortened to `longest` (metres).
fn limited(v: Vec3, longest: f64) -> Vec3 {
    let length = v.norm();
    if length > longest { v * (longest / length) } else { v }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_displacement_is_shortened_but_not_turned() {
        let v = Vec3::new(3.0, 0.0, 4.0);
        assert!((limited(v, 1.0) - v / 5.0).norm() < 1e-15);
        assert_eq!(limited(v, 5.0), v);
    }

    #[test]
    fn confidence_is_one_half_at_a_quarter_of_the_range() {
        let [none, quarter, whole] = [0.0, 0.25, 1.0].map(|sigma| {
            confidence(&Pull { displacement: Vec3::zeros(), sigma, is_measured: true }, 1.0)
        });
        assert_eq!((none, quarter), (1.0, 0.5));
        assert!(whole < 0.06, "{whole}");
    }
}
