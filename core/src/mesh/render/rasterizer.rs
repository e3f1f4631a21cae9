//! Rasterization of triangles to shaded samples with a z-buffer (Pineda 1988, A parallel algorithm
//! for polygon rasterization).

use super::colours::{BACK_FACE_RGB, BACKGROUND_RGB};
use crate::geometry::Vec3;
use rayon::prelude::*;

/// Rows that one task draws: few enough to share the work, many enough that most triangles lie in a
/// single band.
const BAND_ROWS: usize = 64;
/// Intensity of the ambient light.
const AMBIENT_INTENSITY: f64 = 0.22;
/// The lights; intensities sum with the ambient light to slightly above 1.
const LIGHTS: [Light; 2] = [
    Light { direction: [-0.40, 0.60, 0.69], intensity: 0.63 },
    Light { direction: [0.80, 0.10, 0.59], intensity: 0.25 },
];

/// A directional light.
struct Light {
    /// Direction to the light, camera frame (x right, y up, z to the viewer).
    direction: [f64; 3],
    intensity: f64,
}

/// A corner of a triangle, projected to the canvas.
#[derive(Clone, Copy)]
pub(super) struct ProjectedVertex {
    /// Samples from the left.
    pub(super) x: f64,
    /// Samples from the top.
    pub(super) y: f64,
    /// Distance along the viewing direction, metres; larger is farther.
    pub(super) depth: f64,
    /// Normal in the camera frame.
    pub(super) normal: Vec3,
    pub(super) colour: [f64; 3],
}

/// The size of the raster, samples.
pub(super) struct Canvas {
    pub(super) width: usize,
    pub(super) height: usize,
}

impl Canvas {
    /// Draws the triangles; returns the colours of all samples, row by row.
    pub(super) fn draw(&self, triangles: &[[ProjectedVertex; 3]]) -> Vec<[u8; 3]> {
        let mut colours = vec![BACKGROUND_RGB; self.width * self.height];
        colours.par_chunks_mut(BAND_ROWS * self.width).enumerate().for_each(|(index, colours)| {
            let mut band = Band {
                top: index * BAND_ROWS,
                width: self.width,
                depths: vec![f64::INFINITY; colours.len()],
                colours,
            };
            for triangle in triangles {
                band.draw(triangle);
            }
        });
        colours
    }
}

/// Successive rows of the raster.
struct Band<'a> {
    top: usize,
    width: usize,
    depths: Vec<f64>,
    colours: &'a mut [[u8; 3]],
}

impl Band<'_> {
    /// Draws the part of a triangle that lies in the band.
    fn draw(&mut self, corners: &[ProjectedVertex; 3]) {
        let [a, b, c] = corners;
        let area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        if !area.is_finite() || area == 0.0 {
            return;
        }
        // y runs downwards: counter-clockwise triangles have a negative area.
        let front = area < 0.0;
        let height = self.colours.len() / self.width;
        let rows = covered_samples(corners.map(|c| c.y - self.top as f64), height);
        for row in rows {
            for column in covered_samples(corners.map(|c| c.x), self.width) {
                let (x, y) = (column as f64 + 0.5, (self.top + row) as f64 + 0.5);
                let weights = [[b, c], [c, a], [a, b]].map(|edge| edge_function(edge, x, y) / area);
                if weights.iter().any(|w| *w < 0.0) {
                    continue;
                }
                let depth = (0..3).map(|i| weights[i] * corners[i].depth).sum();
                let sample = row * self.width + column;
                if depth < self.depths[sample] {
                    self.depths[sample] = depth;
                    self.colours[sample] = shade(corners, weights, front);
                }
            }
        }
    }
}

/// Doubled signed area of the triangle of an edge and the point (x, y).
fn edge_function([p, q]: [&ProjectedVertex; 2], x: f64, y: f64) -> f64 {
    (p.x - x) * (q.y - y) - (p.y - y) * (q.x - x)
}

/// The samples whose centres may lie between the smallest and the largest of `values`.
fn covered_samples(values: [f64; 3], count: usize) -> std::ops::Range<usize> {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min) - 0.5;
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max) + 0.5;
    // Casts from floating point saturate, which clips samples outside of the raster.
    (low.floor() as usize).min(count)..(high.ceil() as usize).min(count)
}

/// Lambertian shading of the point with barycentric `weights`; back faces have a colour of their
/// own.
fn shade(corners: &[ProjectedVertex; 3], weights: [f64; 3], front: bool) -> [u8; 3] {
    let normal: Vec3 = (0..3).map(|i| corners[i].normal * weights[i]).sum();
    let normal = normal.try_normalize(0.0).unwrap_or_else(Vec3::z) * if front { 1.0 } else { -1.0 };
    let diffuse = LIGHTS.iter().map(|light| {
        light.intensity * normal.dot(&Vec3::from(light.direction).normalize()).max(0.0)
    });
    let light = (AMBIENT_INTENSITY + diffuse.sum::<f64>()).min(1.0);
    std::array::from_fn(|channel| {
        let own: f64 = (0..3).map(|i| weights[i] * corners[i].colour[channel]).sum();
        let colour = if front { own } else { BACK_FACE_RGB[channel].into() };
        (colour * light).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(x: f64, y: f64, depth: f64, colour: [f64; 3]) -> ProjectedVertex {
        ProjectedVertex { x, y, depth, normal: Vec3::z(), colour }
    }

    /// A triangle that faces the viewer and covers the upper left half of a canvas of 100 x 100
    /// samples.
    fn half(depth: f64, colour: [f64; 3]) -> [ProjectedVertex; 3] {
        [(0.0, 0.0), (0.0, 100.0), (100.0, 0.0)].map(|(x, y)| corner(x, y, depth, colour))
    }

    const CANVAS: Canvas = Canvas { width: 100, height: 100 };

    #[test]
    fn a_triangle_covers_the_samples_whose_centres_it_contains() {
        let samples = CANVAS.draw(&[half(1.0, [100.0; 3])]);
        for (i, colour) in samples.iter().enumerate() {
            let (x, y) = ((i % 100) as f64 + 0.5, (i / 100) as f64 + 0.5);
            assert_eq!(*colour != BACKGROUND_RGB, x + y <= 100.0, "({x}, {y})");
        }
    }

    #[test]
    fn the_nearer_triangle_wins_in_either_order() {
        let (near, far) = (half(1.0, [200.0, 0.0, 0.0]), half(2.0, [0.0, 200.0, 0.0]));
        let alone = CANVAS.draw(&[near]);
        assert_eq!(CANVAS.draw(&[near, far]), alone);
        assert_eq!(CANVAS.draw(&[far, near]), alone);
    }

    #[test]
    fn a_back_face_has_its_own_colour_and_a_flat_triangle_none() {
        let [a, b, c] = half(1.0, [200.0, 0.0, 0.0]);
        let back = CANVAS.draw(&[[a, c, b]])[0];
        let shares = [0, 1, 2].map(|i| f64::from(back[i]) / f64::from(BACK_FACE_RGB[i]));
        assert!(shares.iter().all(|s| (s - shares[0]).abs() < 0.02), "{back:?}");
        assert!(CANVAS.draw(&[[a, b, b]]).iter().all(|s| *s == BACKGROUND_RGB));
    }

    #[test]
    fn spans_are_clipped_to_the_raster() {
        assert_eq!(covered_samples([2.2, 5.7, 3.0], 10), 1..7);
        assert_eq!(covered_samples([-8.0, 25.0, 0.0], 10), 0..10);
        assert!(covered_samples([-8.0, -3.0, -5.0], 10).is_empty());
        assert!(covered_samples([18.0, 13.0, 15.0], 10).is_empty());
    }
}
