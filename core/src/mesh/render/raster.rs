//! Triangles to shaded samples, with a z-buffer (Pineda 1988, A parallel algorithm for polygon rasterization).

use super::{BACK_FACE, BACKGROUND};
use crate::geometry::Vec3;
use rayon::prelude::*;

/// Rows that are drawn together: small enough to share the work, large enough that most triangles lie in one band.
const BAND: usize = 64;
/// Light that falls everywhere.
const AMBIENT: f64 = 0.22;
/// Directions to the lights (camera frame: x right, y up, z to the viewer) and their strengths.
const LIGHTS: [([f64; 3], f64); 2] = [([-0.40, 0.60, 0.69], 0.63), ([0.80, 0.10, 0.59], 0.25)];

/// A corner of a triangle on the canvas.
#[derive(Clone, Copy)]
pub(super) struct Corner {
    /// Samples from the left.
    pub(super) x: f64,
    /// Samples from the top.
    pub(super) y: f64,
    /// Larger is farther.
    pub(super) depth: f64,
    /// Camera frame.
    pub(super) normal: Vec3,
    pub(super) colour: [f64; 3],
}

/// The size of what is drawn on, samples.
pub(super) struct Canvas {
    pub(super) width: usize,
    pub(super) height: usize,
}

impl Canvas {
    /// The colours of all samples, row by row.
    pub(super) fn draw(&self, triangles: &[[Corner; 3]]) -> Vec<[u8; 3]> {
        let mut colours = vec![BACKGROUND; self.width * self.height];
        colours.par_chunks_mut(BAND * self.width).enumerate().for_each(|(index, colours)| {
            let mut band = Band {
                top: index * BAND,
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

struct Band<'a> {
    top: usize,
    width: usize,
    depths: Vec<f64>,
    colours: &'a mut [[u8; 3]],
}

impl Band<'_> {
    fn draw(&mut self, corners: &[Corner; 3]) {
        let [a, b, c] = corners;
        let area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        if !area.is_finite() || area == 0.0 {
            return;
        }
        // y runs downwards: counter-clockwise triangles have a negative area.
        let front = area < 0.0;
        let height = self.colours.len() / self.width;
        let rows = span(corners.map(|c| c.y - self.top as f64), height);
        for row in rows {
            for column in span(corners.map(|c| c.x), self.width) {
                let (x, y) = (column as f64 + 0.5, (self.top + row) as f64 + 0.5);
                let edge =
                    |p: &Corner, q: &Corner| ((p.x - x) * (q.y - y) - (p.y - y) * (q.x - x)) / area;
                let weights = [edge(b, c), edge(c, a), edge(a, b)];
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

/// The samples whose centres may lie between the smallest and the largest of `values`.
fn span(values: [f64; 3], count: usize) -> std::ops::Range<usize> {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min) - 0.5;
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max) + 0.5;
    // Casts from float saturate, so that what lies outside is cut off.
    (low.floor() as usize).min(count)..(high.ceil() as usize).min(count)
}

fn shade(corners: &[Corner; 3], weights: [f64; 3], front: bool) -> [u8; 3] {
    let normal: Vec3 = (0..3).map(|i| corners[i].normal * weights[i]).sum();
    let normal = normal.try_normalize(0.0).unwrap_or_else(Vec3::z) * if front { 1.0 } else { -1.0 };
    let lit = |(direction, strength): &([f64; 3], f64)| {
        strength * normal.dot(&Vec3::from(*direction).normalize()).max(0.0)
    };
    let light = (AMBIENT + LIGHTS.iter().map(lit).sum::<f64>()).min(1.0);
    std::array::from_fn(|channel| {
        let own: f64 = (0..3).map(|i| weights[i] * corners[i].colour[channel]).sum();
        let colour = if front { own } else { BACK_FACE[channel].into() };
        (colour * light).round() as u8
    })
}
