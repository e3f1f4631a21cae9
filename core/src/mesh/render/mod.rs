//! Pictures of a mesh by an orthographic z-buffer rasterizer.
//!
//! ```
//! use puffer_core::geometry::{Aabb, Vec3};
//! use puffer_core::mesh::isosurface::Lattice;
//! use puffer_core::mesh::render::{BACKGROUND_RGB, RenderView, render};
//!
//! let bounds = Aabb { min: Vec3::repeat(-0.06), max: Vec3::repeat(0.06) };
//! let ball = Lattice::sample(&bounds, 5e-3, |p| p.norm() - 0.05).extract_isosurface();
//! let image = render(&ball, RenderView::default(), 64, 48);
//! assert_eq!((image.width, image.height, image.rgb.len()), (64, 48, 3 * 64 * 48));
//! assert!(image.rgb.chunks(3).any(|pixel| pixel != BACKGROUND_RGB));
//! ```

mod camera;
mod colours;
mod image;
mod rasterizer;
mod sheet;
#[cfg(test)]
mod tests;

pub use camera::RenderView;
pub use colours::BACKGROUND_RGB;
pub use image::Image;
pub use sheet::render_sheet;

use crate::mesh::Mesh;
use camera::Camera;

/// Draws the mesh, fitted into `width` x `height` pixels.
///
/// Shading is smooth if the mesh has normals and flat otherwise. The colours are those of sigma, as
/// in PLY files, or grey if the mesh has no sigma; surface seen from inside is violet. An empty
/// mesh gives an empty picture.
pub fn render(mesh: &Mesh, view: RenderView, width: usize, height: usize) -> Image {
    let camera = Camera::new(view, mesh);
    camera.draw(mesh, camera.fit_scale(width, height), width, height)
}
