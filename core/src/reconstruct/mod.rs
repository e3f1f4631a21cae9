//! From a filtered cloud to a watertight mesh with confidence (Wiedemann 2014, §2.4).
//!
//! Three steps: *inflate* a mesh in the space that the points enclose, *detail* it onto the points, and give each
//! vertex its standard deviation. Every step starts from a closed two-manifold without self-intersections and
//! ends with one.

mod attract;
mod balloon;
mod detail;
mod field;
mod guard;
mod shape;
mod support;
mod topology;
mod votes;
mod winding;

use crate::geometry::{Aabb, Cloud, Vec3, median};
use crate::mesh::{HalfEdgeMesh, Mesh};
use crate::scans::Support;
use crate::{Progress, Result};
use attract::{Measurements, Pull};
use support::with_support_plane;

crate::choice! {
    /// How the mesh is inflated.
    pub enum InflateMethod {
        /// The inside space by the winding number of the points: closes holes, finds the true genus.
        Field = "field",
        /// The thesis's: a tetrahedron grows vertex by vertex.
        Thesis = "thesis",
    }
}

crate::choice! {
    /// How the mesh is brought to the points.
    pub enum DetailMethod {
        /// Implicit moving least squares, isotropic remeshing.
        Implicit = "implicit",
        /// The thesis's: mean of the points in the finding range, splits, smoothing, regularising.
        Thesis = "thesis",
    }
}

crate::params! {
    /// Parameters of the reconstruction.
    pub struct ReconstructParams("reconstruct") {
        /// How the mesh is inflated.
        inflate: InflateMethod = InflateMethod::Field;
        /// How the mesh is brought to the points.
        detail: DetailMethod = DetailMethod::Implicit;
        /// Edge length of the finished mesh (the thesis's `l_m`); 0 takes it from the distance of the points.
        edge_length: f64 = 0.0, in [0.0, 1.0], unit "m";
        /// Edge length at the start of detailing (`l_0`), in units of the voxel edge.
        start_edge: f64 = 1.3, in [0.5, 10.0];
        /// Voxel edge of the inflation (`l`), for the field the distance between the corners of its lattice; 0 takes it
        /// from the distance and the noise of the points.
        voxel_edge: f64 = 0.0, in [0.0, 1.0], unit "m";
        /// Steps from the first to the finished edge length (`i_max`).
        iterations: usize = 4, in [0, 1000];
        /// What the object stands on; its underside then closes there.
        support: Support = Support::None;
        /// Separate bodies that are kept at most, the largest first.
        components: usize = 1, in [1, 1000];
        /// Strength `k_s` of the thesis's smoothing.
        smoothing: f64 = 0.3, in [0.0, 0.5];
        /// Angle between vertex normals from which the thesis smooths.
        smooth_angle_min: f64 = 0.0, in [0.0, 3.15], unit "rad";
        /// Angle between vertex normals up to which the thesis smooths: sharper edges stay.
        smooth_angle_max: f64 = 1.0, in [0.0, 3.15], unit "rad";
        /// Strength `k_reg` of the thesis's regularising.
        regularising: f64 = 0.1, in [0.0, 0.5];
    }
}

/// The lengths that the reconstruction works with, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scale {
    /// Distance between the filtered points.
    pub points: f64,
    /// Edge of a voxel.
    pub voxel: f64,
    /// Distance between the corners of the field's lattice.
    pub lattice: f64,
    /// Edge of the finished mesh.
    pub edge: f64,
    /// Edge at the start of detailing.
    pub start_edge: f64,
}

/// Edges per distance of points: with shorter ones the mesh would follow single points' noise.
const EDGE_PER_SPACING: f64 = 1.6;

/// Distance of the lattice's corners as a share of the narrowest wall or slot that the points can tell: one corner
/// must fall between its sides.
const LATTICE_PER_GAP: f64 = 0.8;
/// That wall is one distance of the points thick, less so many standard deviations: noise moves both sides.
const MIN_GAP_SIGMAS: f64 = 3.0;
/// Distance of the lattice's corners per distance of points at least, however noisy these are.
const MIN_LATTICE_PER_SPACING: f64 = 0.4;

/// Corners of the lattice at most, unless its spacing is given: beyond it thin walls are not worth the time (some seconds),
/// and the lattice is coarser, up to the edge length of the mesh.
const MAX_AUTOMATIC_CORNERS: f64 = 3e7;

impl Scale {
    fn of(cloud: &Cloud, params: &ReconstructParams) -> Scale {
        let points = spacing(cloud);
        let given = |value: f64, automatic: f64| if value > 0.0 { value } else { automatic };
        let edge = given(params.edge_length, EDGE_PER_SPACING * points);
        let voxel = given(params.voxel_edge, edge.max(1.2 * points));
        let sigma = median(cloud.sigma.iter().copied().filter(|s| s.is_finite()).collect());
        let gap = points - MIN_GAP_SIGMAS * sigma.unwrap_or(0.0);
        let finest = MIN_LATTICE_PER_SPACING * points;
        let volume = Aabb::of(&cloud.points).extent().iter().product::<f64>();
        let affordable = (volume / MAX_AUTOMATIC_CORNERS).cbrt();
        let wanted = (LATTICE_PER_GAP * gap).max(finest).max(affordable);
        let lattice = given(params.voxel_edge, wanted.min(edge));
        Scale { points, voxel, lattice, edge, start_edge: (params.start_edge * voxel).max(edge) }
    }

    /// Width of the search for points round a vertex while edges have length `edge`.
    fn width(&self, edge: f64) -> f64 {
        self.points.max(0.5 * edge)
    }
}

/// Median distance of the points to their nearest neighbours, as if on a hexagonal lattice, metres.
fn spacing(cloud: &Cloud) -> f64 {
    let tree = crate::geometry::KdTree::new(&cloud.points);
    let stride = cloud.len().div_ceil(2000).max(1);
    let fourth = |p: &Vec3| tree.nearest_n(p, 5).last().map(|n| n.1.sqrt());
    median(cloud.points.iter().step_by(stride).filter_map(fourth).collect()).unwrap_or(1e-3)
}

/// A closed, two-manifold, oriented mesh without self-intersections round the volume that the points enclose, with
/// normals, standard deviations and what was observed. Points supported by 0 scans shape it but do not count as
/// measured.
///
/// # Errors
/// [`Error::Input`](crate::Error::Input) if the points are fewer than 50, lie in a plane or enclose nothing;
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub fn reconstruct(cloud: &Cloud, params: &ReconstructParams, progress: &Progress) -> Result<Mesh> {
    // With fewer points no surface in space is described: a cube has 8 corners, a face of it needs a few.
    cloud.check_volume(50)?;
    let scale = Scale::of(cloud, params);
    progress.report("inflate", 0.0)?;
    let supported;
    let cloud = match params.support {
        Support::None => cloud,
        Support::Table => {
            supported = with_support_plane(cloud, scale.points);
            &supported
        }
    };
    let inflated = match params.inflate {
        InflateMethod::Field => {
            field::inflate(cloud, scale.lattice, scale.points, params.components, progress)?
        }
        InflateMethod::Thesis => balloon::inflate(cloud, scale.voxel, progress)?,
    };
    progress.report("inflate", 1.0)?;
    let measurements = Measurements::new(cloud, 2.5 * scale.width(scale.edge));
    let mut mesh = HalfEdgeMesh::new(&inflated)?;
    detail::detail(&mut mesh, &measurements, &scale, params, progress)?;
    Ok(with_confidence(mesh, &measurements, &scale, params))
}

/// The mesh with normals and, from the points near each vertex, its standard deviation (Wiedemann 2014, §2.4.6).
fn with_confidence(
    mesh: HalfEdgeMesh,
    measurements: &Measurements,
    scale: &Scale,
    params: &ReconstructParams,
) -> Mesh {
    // Closing the gaps first makes the lists of vertices agree.
    let mut plain = mesh.into_mesh();
    plain.compute_normals();
    let width = scale.width(scale.edge);
    let pull = |v: usize| -> Option<Pull> {
        measurements.pull(&plain.vertices[v], &plain.normals[v], width, params.detail)
    };
    let pulls: Vec<Option<Pull>> = (0..plain.vertices.len()).map(pull).collect();
    // What is left of the pull is error too.
    let sigma = |p: &Option<Pull>| match p {
        Some(p) if p.measured => p.sigma.hypot(p.displacement.norm()),
        _ => f64::NAN,
    };
    plain.sigma = pulls.iter().map(sigma).collect();
    let measured = |p: &Option<Pull>| p.as_ref().is_some_and(|p| p.measured);
    plain.observed = pulls.iter().map(measured).collect();
    plain
}

#[cfg(test)]
mod tests;
