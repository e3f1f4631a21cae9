//! Pictures of a mesh: an orthographic z-buffer rasteriser.

mod raster;

use super::Mesh;
use super::io::{confidence_colour, confidence_scale};
use crate::geometry::{Vec3, any_orthogonal};
use raster::{Canvas, Corner};

/// Colour where no surface is; no shaded surface takes it.
pub const BACKGROUND: [u8; 3] = [255, 255, 255];
/// Surface without sigma.
const GREY: [u8; 3] = [215, 215, 220];
/// Triangles seen from inside: they show holes and wrong orientation.
const BACK_FACE: [u8; 3] = [150, 50, 200];
/// Part of the picture left free on each side.
const MARGIN: f64 = 0.03;
/// Samples in a pixel, along each axis.
const SAMPLES: usize = 2;

/// A picture, row by row from the top, three bytes (sRGB) a pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `3 * width * height` bytes.
    pub rgb: Vec<u8>,
}

/// From where to look, in the mesh's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderView {
    /// The direction in which the viewer looks; need not be of unit length.
    pub direction: Vec3,
    /// What shall point up in the picture; need not be perpendicular to the direction.
    pub up: Vec3,
}

impl Default for RenderView {
    /// From the front, the right and above; z up.
    fn default() -> RenderView {
        RenderView { direction: Vec3::new(-0.6, 1.0, -0.5), up: Vec3::z() }
    }
}

/// The sides of a sheet: front (seen along +y), right, back, left, top, bottom.
const SIDES: [([f64; 3], [f64; 3]); 6] = [
    ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]),
    ([-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
    ([0.0, -1.0, 0.0], [0.0, 0.0, 1.0]),
    ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
    ([0.0, 0.0, -1.0], [0.0, 1.0, 0.0]),
    ([0.0, 0.0, 1.0], [0.0, 1.0, 0.0]),
];

/// Draws the mesh, fitted into `width` x `height` pixels.
///
/// Smooth where the mesh has normals, else flat; coloured by sigma where it has that (the colours of the PLY
/// file), else grey; what is seen from inside is violet. An empty mesh gives an empty picture.
pub fn render(mesh: &Mesh, view: RenderView, width: usize, height: usize) -> Image {
    let camera = Camera::new(view, mesh);
    camera.draw(mesh, camera.fit(width, height), width, height)
}

/// Draws the four sides, the top and the bottom in one picture of `width` x `height` pixels, all to one scale:
/// above front, right and back; below left, top and bottom. z is up.
pub fn render_sheet(mesh: &Mesh, width: usize, height: usize) -> Image {
    let (cell_width, cell_height) = (width / 3, height / 2);
    let cameras = SIDES.map(|(direction, up)| {
        Camera::new(RenderView { direction: direction.into(), up: up.into() }, mesh)
    });
    let fits = cameras.iter().map(|camera| camera.fit(cell_width, cell_height));
    let scale = fits.fold(f64::INFINITY, f64::min);
    let mut sheet = Image::empty(width, height);
    for (index, camera) in cameras.iter().enumerate() {
        let cell = camera.draw(mesh, scale, cell_width, cell_height);
        sheet.paste(&cell, index % 3 * cell_width, index / 3 * cell_height);
    }
    sheet
}

impl Image {
    fn empty(width: usize, height: usize) -> Image {
        Image { width, height, rgb: BACKGROUND.repeat(width * height) }
    }

    /// Puts `part`, which must fit, with its upper left corner at (x, y).
    fn paste(&mut self, part: &Image, x: usize, y: usize) {
        if part.width == 0 {
            return;
        }
        for (row, source) in part.rgb.chunks_exact(3 * part.width).enumerate() {
            let start = 3 * ((y + row) * self.width + x);
            self.rgb[start..start + source.len()].copy_from_slice(source);
        }
    }
}

/// An orthographic camera before the mesh's middle; x right, y up, z towards the viewer.
struct Camera {
    axes: [Vec3; 3],
    /// Middle of the projected mesh, camera frame, metres.
    middle: Vec3,
    /// Extent of the projected mesh, metres.
    extent: Vec3,
}

impl Camera {
    fn new(view: RenderView, mesh: &Mesh) -> Camera {
        let z = (-view.direction).try_normalize(0.0).unwrap_or_else(Vec3::z);
        let x = view.up.cross(&z).try_normalize(1e-9).unwrap_or_else(|| any_orthogonal(&z));
        let mut camera =
            Camera { axes: [x, z.cross(&x), z], middle: Vec3::zeros(), extent: Vec3::zeros() };
        let mut bounds = crate::geometry::Aabb::EMPTY;
        for vertex in mesh.vertices.iter().filter(|v| v.iter().all(|c| c.is_finite())) {
            bounds.insert(&camera.turned(vertex));
        }
        if bounds.extent().norm() > 0.0 {
            (camera.middle, camera.extent) = (bounds.center(), bounds.extent());
        }
        camera
    }

    fn turned(&self, v: &Vec3) -> Vec3 {
        Vec3::new(v.dot(&self.axes[0]), v.dot(&self.axes[1]), v.dot(&self.axes[2]))
    }

    /// Pixels in a metre with which the mesh fills the picture.
    fn fit(&self, width: usize, height: usize) -> f64 {
        let fit = |pixels: usize, extent: f64| {
            if extent > 0.0 { pixels as f64 * (1.0 - 2.0 * MARGIN) / extent } else { f64::INFINITY }
        };
        fit(width, self.extent.x).min(fit(height, self.extent.y))
    }

    fn draw(&self, mesh: &Mesh, scale: f64, width: usize, height: usize) -> Image {
        if width == 0 || height == 0 || !scale.is_finite() {
            return Image::empty(width, height);
        }
        let scale = scale * SAMPLES as f64;
        let canvas = Canvas { width: width * SAMPLES, height: height * SAMPLES };
        let sigma_scale = confidence_scale(&mesh.sigma);
        let corner = |triangle: usize, v: u32| {
            let (v, offset) = (v as usize, self.turned(&mesh.vertices[v as usize]) - self.middle);
            let normal = mesh.normals.get(v).copied();
            let colour = mesh.sigma.get(v).map_or(GREY, |s| confidence_colour(*s, sigma_scale));
            Corner {
                x: canvas.width as f64 / 2.0 + offset.x * scale,
                y: canvas.height as f64 / 2.0 - offset.y * scale,
                depth: -offset.z,
                normal: self.turned(&normal.unwrap_or_else(|| mesh.triangle_normal(triangle))),
                colour: colour.map(f64::from),
            }
        };
        let triangles: Vec<[Corner; 3]> = mesh
            .triangles
            .iter()
            .enumerate()
            .map(|(index, triangle)| triangle.map(|v| corner(index, v)))
            .collect();
        reduce(&canvas.draw(&triangles), width, height)
    }
}

/// The mean of the samples of each pixel.
fn reduce(samples: &[[u8; 3]], width: usize, height: usize) -> Image {
    let mut rgb = Vec::with_capacity(3 * width * height);
    for y in 0..height {
        for x in 0..width {
            let inside = (0..SAMPLES * SAMPLES).map(|s| {
                let (row, column) = (y * SAMPLES + s / SAMPLES, x * SAMPLES + s % SAMPLES);
                samples[row * width * SAMPLES + column]
            });
            let sum =
                inside.fold([0u32; 3], |sum, c| std::array::from_fn(|i| sum[i] + u32::from(c[i])));
            rgb.extend(sum.map(|channel| (channel / (SAMPLES * SAMPLES) as u32) as u8));
        }
    }
    Image { width, height, rgb }
}

#[cfg(test)]
mod tests;
