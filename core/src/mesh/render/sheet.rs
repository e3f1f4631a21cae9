//! Sheets of several views.

use super::camera::{Camera, RenderView};
use super::image::Image;
use crate::geometry::Vec3;
use crate::mesh::Mesh;

/// The views of a sheet: front (seen along +y), right, back, left, top, bottom.
const SHEET_VIEWS: [RenderView; 6] = [
    RenderView { direction: Vec3::new(0.0, 1.0, 0.0), up: Vec3::new(0.0, 0.0, 1.0) },
    RenderView { direction: Vec3::new(-1.0, 0.0, 0.0), up: Vec3::new(0.0, 0.0, 1.0) },
    RenderView { direction: Vec3::new(0.0, -1.0, 0.0), up: Vec3::new(0.0, 0.0, 1.0) },
    RenderView { direction: Vec3::new(1.0, 0.0, 0.0), up: Vec3::new(0.0, 0.0, 1.0) },
    RenderView { direction: Vec3::new(0.0, 0.0, -1.0), up: Vec3::new(0.0, 1.0, 0.0) },
    RenderView { direction: Vec3::new(0.0, 0.0, 1.0), up: Vec3::new(0.0, 1.0, 0.0) },
];
/// Views in a row of the sheet.
const COLUMNS: usize = 3;
/// Rows of views.
const ROWS: usize = 2;

/// Draws six views in one picture of `width` x `height` pixels, all to the same scale: front, right
/// and back in the upper row, left, top and bottom in the lower one. z is up.
pub fn render_sheet(mesh: &Mesh, width: usize, height: usize) -> Image {
    let (cell_width, cell_height) = (width / COLUMNS, height / ROWS);
    let cameras = SHEET_VIEWS.map(|view| Camera::new(view, mesh));
    let scales = cameras.iter().map(|camera| camera.fit_scale(cell_width, cell_height));
    let scale = scales.fold(f64::INFINITY, f64::min);
    let mut sheet = Image::empty(width, height);
    for (index, camera) in cameras.iter().enumerate() {
        let cell = camera.draw(mesh, scale, cell_width, cell_height);
        sheet.paste(&cell, index % COLUMNS * cell_width, index / COLUMNS * cell_height);
    }
    sheet
}
