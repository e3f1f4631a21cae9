//! From a filtered cloud to a watertight mesh with confidence (Wiedemann 2014, §2.4 and §3.5).
//!
//! There are three steps: *inflate* a mesh in the space that the points enclose, *detail* it onto
//! the points, and give each vertex its standard deviation. Every step starts from a closed
//! two-manifold without self-intersections and ends with one.
//!
//! ```
//! use puffer_core::Progress;
//! use puffer_core::geometry::{Cloud, Vec3};
//! use puffer_core::mesh::{is_closed, is_two_manifold};
//! use puffer_core::reconstruct::{ReconstructParams, reconstruct};
//!
//! // Points spread evenly over a ball of 5 cm radius (Fibonacci's lattice).
//! let mut cloud = Cloud::default();
//! for i in 0..2000 {
//!     let (z, turn) = (1.0 - (f64::from(i) + 0.5) / 1000.0, 2.399_963 * f64::from(i));
//!     let radius = (1.0 - z * z).sqrt();
//!     let normal = Vec3::new(radius * turn.cos(), radius * turn.sin(), z);
//!     cloud.push(normal * 0.05, normal, 1e-4, 1);
//! }
//! let mesh = reconstruct(&cloud, &ReconstructParams::default(), &Progress::silent())?;
//! assert!(is_closed(&mesh) && is_two_manifold(&mesh));
//! let volume = 4.0 / 3.0 * std::f64::consts::PI * 0.05_f64.powi(3);
//! assert!((mesh.volume() / volume - 1.0).abs() < 0.02);
//! # Ok::<(), puffer_core::Error>(())
//! ```

mod attraction;
mod balloon;
mod confidence;
mod detailing;
mod field;
mod guard;
mod params;
mod scale;
mod smoothing;
mod support_plane;
mod topology_filter;
mod votes;
mod winding_number;

pub use params::{DetailMethod, InflateMethod, ReconstructParams};

use crate::geometry::Cloud;
use crate::mesh::{HalfEdgeMesh, Mesh};
use crate::scan::Support;
use crate::{Progress, Result};
use attraction::{Measurements, SEARCH_RADIUS_RATIO};
use confidence::with_confidence;
use detailing::DetailStrategy;
use scale::Scale;
use support_plane::with_support_plane;

/// Points that describe a surface in space at least: a cube has 8 corners, and a face of it needs a
/// few.
const MIN_POINTS: usize = 50;

/// A closed, two-manifold, oriented mesh without self-intersections round the volume that the
/// points enclose, with normals, standard deviations and what was observed. Points supported by 0
/// scans shape it but do not count as measured.
///
/// # Errors
/// [`Error::Input`](crate::Error::Input) if there are fewer than 50 points, or if they lie in a
/// plane or enclose nothing; [`Error::Cancelled`](crate::Error::Cancelled).
pub fn reconstruct(cloud: &Cloud, params: &ReconstructParams, progress: &Progress) -> Result<Mesh> {
    cloud.check_volume(MIN_POINTS)?;
    let scale = Scale::new(cloud, params);
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
    let width = scale.search_width(scale.edge);
    let measurements = Measurements::new(cloud, SEARCH_RADIUS_RATIO * width);
    let mut mesh = HalfEdgeMesh::new(&inflated)?;
    let strategy = DetailStrategy::new(&measurements, &scale, params);
    strategy.detail(&mut mesh, progress)?;
    Ok(with_confidence(mesh, &measurements, strategy.pull, width))
}

#[cfg(test)]
mod tests;
