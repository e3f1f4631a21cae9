//! The orthographic camera.

use super::colours::SURFACE_RGB;
use super::image::Image;
use super::rasterizer::{Canvas, ProjectedVertex};
use crate::geometry::{Aabb, Vec3, any_orthogonal};
use crate::mesh::Mesh;
use crate::mesh::io::{confidence_colour, confidence_scale};

/// Share of the picture that is left free on each side.
pub(super) const MARGIN_RATIO: f64 = 0.03;
/// Samples of a pixel along each axis.
const SAMPLES_PER_AXIS: usize = 2;
/// Directions whose cross product is shorter than this are parallel.
const MIN_CROSS_NORM: f64 = 1e-9;
/// The viewing direction from the front, the right and above.
const DEFAULT_DIRECTION: [f64; 3] = [-0.6, 1.0, -0.5];

/// A viewing direction in the mesh's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderView {
    /// The direction in which the viewer looks; need not be of unit length.
    pub direction: Vec3,
    /// The direction that points up in the picture; need not be perpendicular to the viewing
    /// direction.
    pub up: Vec3,
}

impl Default for RenderView {
    /// From the front, the right and above; z up.
    fn default() -> RenderView {
        RenderView { direction: DEFAULT_DIRECTION.into(), up: Vec3::z() }
    }
}

/// An orthographic camera in front of the mesh's middle; x right, y up, z towards the viewer.
pub(super) struct Camera {
    axes: [Vec3; 3],
    /// Middle of the projected mesh, camera frame, metres.
    middle: Vec3,
    /// Extent of the projected mesh, metres.
    extent: Vec3,
}

impl Camera {
    /// A camera that looks at `mesh`.
    pub(super) fn new(view: RenderView, mesh: &Mesh) -> Camera {
        let z = (-view.direction).try_normalize(0.0).unwrap_or_else(Vec3::z);
        let x =
            view.up.cross(&z).try_normalize(MIN_CROSS_NORM).unwrap_or_else(|| any_orthogonal(&z));
        let mut camera =
            Camera { axes: [x, z.cross(&x), z], middle: Vec3::zeros(), extent: Vec3::zeros() };
        let mut bounds = Aabb::EMPTY;
        for vertex in mesh.vertices.iter().filter(|v| v.iter().all(|c| c.is_finite())) {
            bounds.insert(&camera.to_camera_axes(vertex));
        }
        if bounds.extent().norm() > 0.0 {
            (camera.middle, camera.extent) = (bounds.center(), bounds.extent());
        }
        camera
    }

    /// The components of a vector along the camera's axes.
    fn to_camera_axes(&self, v: &Vec3) -> Vec3 {
        Vec3::new(v.dot(&self.axes[0]), v.dot(&self.axes[1]), v.dot(&self.axes[2]))
    }

    /// Pixels per metre with which the mesh fills the picture; infinite for a mesh without extent.
    pub(super) fn fit_scale(&self, width: usize, height: usize) -> f64 {
        fit_extent(width, self.extent.x).min(fit_extent(height, self.extent.y))
    }

    /// Draws the mesh at `scale` pixels per metre.
    pub(super) fn draw(&self, mesh: &Mesh, scale: f64, width: usize, height: usize) -> Image {
        if width == 0 || height == 0 || !scale.is_finite() {
            return Image::empty(width, height);
        }
        let scale = scale * SAMPLES_PER_AXIS as f64;
        let canvas = Canvas { width: width * SAMPLES_PER_AXIS, height: height * SAMPLES_PER_AXIS };
        let sigma_scale = confidence_scale(&mesh.sigma);
        let triangles = mesh.triangles.iter().enumerate().map(|(index, triangle)| {
            triangle.map(|v| {
                let v = v as usize;
                let offset = self.to_camera_axes(&mesh.vertices[v]) - self.middle;
                let normal = mesh.normals.get(v).copied();
                let normal = normal.unwrap_or_else(|| mesh.triangle_normal(index));
                let sigma = mesh.sigma.get(v);
                let colour = sigma.map_or(SURFACE_RGB, |s| confidence_colour(*s, sigma_scale));
                ProjectedVertex {
                    x: canvas.width as f64 / 2.0 + offset.x * scale,
                    y: canvas.height as f64 / 2.0 - offset.y * scale,
                    depth: -offset.z,
                    normal: self.to_camera_axes(&normal),
                    colour: colour.map(f64::from),
                }
            })
        });
        let triangles: Vec<[ProjectedVertex; 3]> = triangles.collect();
        downsample(&canvas.draw(&triangles), width, height)
    }
}

/// Pixels per metre with which `extent` (metres) fills a side of the picture.
fn fit_extent(pixels: usize, extent: f64) -> f64 {
    if extent > 0.0 { pixels as f64 * (1.0 - 2.0 * MARGIN_RATIO) / extent } else { f64::INFINITY }
}

/// Averages the samples of each pixel.
fn downsample(samples: &[[u8; 3]], width: usize, height: usize) -> Image {
    let mut rgb = Vec::with_capacity(3 * width * height);
    for y in 0..height {
        for x in 0..width {
            let inside = (0..SAMPLES_PER_AXIS * SAMPLES_PER_AXIS).map(|s| {
                let (row, column) = (
                    y * SAMPLES_PER_AXIS + s / SAMPLES_PER_AXIS,
                    x * SAMPLES_PER_AXIS + s % SAMPLES_PER_AXIS,
                );
                samples[row * width * SAMPLES_PER_AXIS + column]
            });
            let sum =
                inside.fold([0u32; 3], |sum, c| std::array::from_fn(|i| sum[i] + u32::from(c[i])));
            rgb.extend(
                sum.map(|channel| (channel / (SAMPLES_PER_AXIS * SAMPLES_PER_AXIS) as u32) as u8),
            );
        }
    }
    Image { width, height, rgb }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_shapes::cuboid;

    #[test]
    fn samples_of_a_pixel_are_averaged() {
        let mut samples = vec![[0; 3]; 16];
        for (i, level) in [(0, 10), (1, 20), (4, 30), (5, 40), (10, 200)] {
            samples[i] = [level; 3];
        }
        let image = downsample(&samples, 2, 2);
        let levels: Vec<u8> = image.rgb.chunks_exact(3).map(|p| p[0]).collect();
        assert_eq!(levels, [25, 0, 0, 50]);
    }

    #[test]
    fn the_axes_are_right_handed_and_the_mesh_fits() {
        let mesh = cuboid(Vec3::zeros(), Vec3::new(0.4, 0.2, 0.1));
        for direction in [Vec3::new(-0.6, 1.0, -0.5), Vec3::z(), Vec3::zeros()] {
            let camera = Camera::new(RenderView { direction, up: Vec3::z() }, &mesh);
            let [x, y, z] = camera.axes;
            assert!((x.cross(&y) - z).norm() < 1e-12 && (x.norm() - 1.0).abs() < 1e-12);
            let scale = camera.fit_scale(300, 200);
            let (width, height) = (camera.extent.x * scale, camera.extent.y * scale);
            assert!(width <= 282.0 + 1e-9 && height <= 188.0 + 1e-9);
            assert!((width - 282.0).abs() < 1e-9 || (height - 188.0).abs() < 1e-9);
        }
    }
}
