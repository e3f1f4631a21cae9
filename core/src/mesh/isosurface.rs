//! The isosurface (zero level set) of a scalar field on a lattice, by marching tetrahedra.
//!
//! Each cube is cut into Kuhn's six tetrahedra around its diagonal from corner 000 to corner 111
//! (Doi and Koide 1991, IEICE Trans. E74). The tetrahedra fit together face to face and each
//! contains one flat triangle or one pair of triangles, so the surface is two-manifold and free of
//! self-intersections by construction, whatever the values are. A layer of outside corners around
//! the lattice closes it.

use super::Mesh;
use crate::geometry::{Aabb, Vec3};
use rayon::prelude::*;

/// Crossings keep this distance from the corners, as a share of the edge, so that no triangle
/// degenerates.
const MIN_CROSSING_RATIO: f64 = 0.05;

/// A tetrahedron of a cell.
struct Tetrahedron {
    /// Corners of the cell (bit 0: x, bit 1: y, bit 2: z).
    corners: [u8; 4],
    /// Whether the corners are in an order of positive orientation.
    positive: bool,
}

/// The six tetrahedra around the diagonal from corner 0 to corner 7: the permutations of the axes,
/// whose parity is the orientation.
const TETRAHEDRA: [Tetrahedron; 6] = [
    Tetrahedron { corners: [0, 1, 3, 7], positive: true },
    Tetrahedron { corners: [0, 1, 5, 7], positive: false },
    Tetrahedron { corners: [0, 2, 6, 7], positive: true },
    Tetrahedron { corners: [0, 2, 3, 7], positive: false },
    Tetrahedron { corners: [0, 4, 5, 7], positive: true },
    Tetrahedron { corners: [0, 4, 6, 7], positive: false },
];

/// A scalar field on the corners of a regular lattice; negative is inside.
///
/// ```
/// use puffer_core::geometry::{Aabb, Vec3};
/// use puffer_core::mesh::isosurface::Lattice;
/// use puffer_core::mesh::{is_closed, is_two_manifold};
///
/// let bounds = Aabb { min: Vec3::repeat(-0.06), max: Vec3::repeat(0.06) };
/// let ball = Lattice::sample(&bounds, 5e-3, |p| p.norm() - 0.05).extract_isosurface();
/// assert!(is_closed(&ball) && is_two_manifold(&ball));
/// assert!(ball.vertices.iter().all(|v| (v.norm() - 0.05).abs() < 5e-4));
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lattice {
    /// Position of corner (0, 0, 0), metres.
    pub origin: Vec3,
    /// Distance between neighbouring corners, metres.
    pub spacing: f64,
    /// Number of corners along x, y and z.
    pub size: [usize; 3],
    /// Value of each corner, x fastest, then y. NaN counts as outside.
    pub values: Vec<f32>,
}

impl Lattice {
    /// Index of corner (x, y, z) in `values`.
    pub fn index(&self, x: usize, y: usize, z: usize) -> usize {
        (z * self.size[1] + y) * self.size[0] + x
    }

    /// Position of corner (x, y, z), metres.
    pub fn position(&self, x: usize, y: usize, z: usize) -> Vec3 {
        self.origin + Vec3::new(x as f64, y as f64, z as f64) * self.spacing
    }

    /// The same lattice without values.
    pub(crate) fn without_values(&self) -> Lattice {
        Lattice { origin: self.origin, spacing: self.spacing, size: self.size, values: Vec::new() }
    }

    /// Samples `field` at `spacing` (metres, positive) over all of `aabb`, in parallel.
    pub fn sample(aabb: &Aabb, spacing: f64, field: impl Fn(&Vec3) -> f64 + Sync) -> Lattice {
        let extent = aabb.extent();
        let size = std::array::from_fn(|i| (extent[i] / spacing).ceil() as usize + 1);
        let mut lattice = Lattice { origin: aabb.min, spacing, size, values: Vec::new() };
        let mut values = vec![0f32; size.iter().product()];
        values.par_chunks_mut(size[0]).enumerate().for_each(|(row, values)| {
            for (x, value) in values.iter_mut().enumerate() {
                *value = field(&lattice.position(x, row % size[1], row / size[1])) as f32;
            }
        });
        lattice.values = values;
        lattice
    }

    /// Extracts the zero level set as a closed, two-manifold mesh without self-intersections,
    /// oriented outwards; it is empty if no corner is inside.
    ///
    /// Everything beyond the lattice is outside. Vertices are in the order of the lattice. Apart
    /// from one sweep over the corners, time and memory grow with the number of crossed cells.
    pub fn extract_isosurface(&self) -> Mesh {
        if self.size.contains(&0) {
            return Mesh::default();
        }
        let layers: Vec<CellLayer> =
            (0..=self.size[2]).into_par_iter().map(|z| self.crossed_cells(z)).collect();
        let mut first_vertices = vec![0usize];
        for layer in &layers {
            first_vertices.push(first_vertices[first_vertices.len() - 1] + layer.vertices.len());
        }
        let triangles: Vec<Vec<[u32; 3]>> = (0..layers.len())
            .into_par_iter()
            .map(|z| self.layer_triangles(&layers, &first_vertices, z))
            .collect();
        let vertices = layers.into_iter().flat_map(|layer| layer.vertices).collect();
        Mesh::new(vertices, triangles.concat())
    }

    /// Value at a corner of the padded lattice, whose corner (1, 1, 1) is corner (0, 0, 0) of this
    /// one.
    fn padded_value(&self, corner: [usize; 3]) -> f64 {
        if (0..3).all(|i| (1..=self.size[i]).contains(&corner[i])) {
            self.values[self.index(corner[0] - 1, corner[1] - 1, corner[2] - 1)].into()
        } else {
            self.spacing
        }
    }

    /// Whether each corner of layer `z` of the padded lattice is inside, x fastest.
    fn inside_flags(&self, z: usize) -> Vec<bool> {
        let [nx, ny, nz] = self.size;
        let mut inside = vec![false; (nx + 2) * (ny + 2)];
        if (1..=nz).contains(&z) {
            for y in 0..ny {
                let from = self.index(0, y, z - 1);
                let to = (y + 1) * (nx + 2) + 1;
                for (flag, value) in
                    inside[to..to + nx].iter_mut().zip(&self.values[from..from + nx])
                {
                    *flag = *value < 0.0;
                }
            }
        }
        inside
    }

    /// The crossed cells of layer `z` of the padded lattice and the vertices on the edges from
    /// their corner
    /// 000. A cell is crossed exactly if one of these seven edges is.
    fn crossed_cells(&self, z: usize) -> CellLayer {
        let (row, rows) = (self.size[0] + 2, self.size[1] + 2);
        let planes = [self.inside_flags(z), self.inside_flags(z + 1)];
        let mut layer = CellLayer::default();
        for y in 0..rows - 1 {
            for x in 0..row - 1 {
                let signs = (0..8).fold(0u8, |signs, c| {
                    let inside = planes[c >> 2][(y + (c >> 1 & 1)) * row + x + (c & 1)];
                    signs | u8::from(inside) << c
                });
                if signs == 0 || signs == 255 {
                    continue;
                }
                let first_vertex = layer.vertices.len() as u32;
                for c in (1..8).filter(|c| (signs >> c & 1) != (signs & 1)) {
                    layer.vertices.push(self.zero_crossing([x, y, z], c));
                }
                layer.cells.push(CrossedCell { corner: (y * row + x) as u32, signs, first_vertex });
            }
        }
        layer
    }

    /// The zero crossing on the edge from the padded corner `from` to corner `c` of its cell,
    /// metres.
    fn zero_crossing(&self, from: [usize; 3], c: usize) -> Vec3 {
        let step = [c & 1, c >> 1 & 1, c >> 2];
        let (a, b) = (
            self.padded_value(from),
            self.padded_value(std::array::from_fn(|i| from[i] + step[i])),
        );
        let t = a / (a - b);
        let t =
            if t.is_finite() { t.clamp(MIN_CROSSING_RATIO, 1.0 - MIN_CROSSING_RATIO) } else { 0.5 };
        let cell = Vec3::from_fn(|i, _| from[i] as f64 - 1.0 + t * step[i] as f64);
        self.origin + cell * self.spacing
    }

    /// The triangles of the cells of layer `z`; `first_vertices` holds the index of each layer's
    /// first vertex.
    fn layer_triangles(
        &self,
        layers: &[CellLayer],
        first_vertices: &[usize],
        z: usize,
    ) -> Vec<[u32; 3]> {
        let row = self.size[0] + 2;
        let plane = row * (self.size[1] + 2);
        let tables = [
            layers[z].cell_by_corner(plane),
            layers.get(z + 1).map_or(vec![], |l| l.cell_by_corner(plane)),
        ];
        let mut triangles = Vec::with_capacity(2 * layers[z].vertices.len());
        for cell in &layers[z].cells {
            for tetrahedron in &TETRAHEDRA {
                add_tetrahedron_triangles(tetrahedron, cell.signs, &mut triangles, |a, b| {
                    // The edge belongs to the cell whose corner 000 is the lower one of its ends.
                    let (low, edge) = (a.min(b), a ^ b);
                    let above = usize::from(low >> 2);
                    let offset = usize::from(low & 1) + usize::from(low >> 1 & 1) * row;
                    let corner = cell.corner as usize + offset;
                    let layer = &layers[z + above];
                    let owner = &layer.cells[tables[above][corner] as usize];
                    let local = (owner.first_vertex + owner.crossed_edges_before(edge)) as usize;
                    let index = (first_vertices[z + above] + local) as u32;
                    IndexedVertex { index, position: layer.vertices[local] }
                });
            }
        }
        triangles
    }
}

/// The crossed cells of one layer of cells, in lattice order.
#[derive(Default)]
struct CellLayer {
    cells: Vec<CrossedCell>,
    vertices: Vec<Vec3>,
}

impl CellLayer {
    /// For each corner of the plane the index of the crossed cell with this corner 000.
    fn cell_by_corner(&self, plane: usize) -> Vec<u32> {
        let mut table = vec![u32::MAX; plane];
        for (i, cell) in self.cells.iter().enumerate() {
            table[cell.corner as usize] = i as u32;
        }
        table
    }
}

/// A crossed cell.
struct CrossedCell {
    /// Index of its corner 000 in the plane.
    corner: u32,
    /// Which of the eight corners are inside, a bit each.
    signs: u8,
    /// Index of its first vertex in the layer.
    first_vertex: u32,
}

impl CrossedCell {
    /// Number of crossed edges from corner 000 that come before the edge to corner `edge`.
    fn crossed_edges_before(&self, edge: u8) -> u32 {
        let flipped = if self.signs & 1 == 1 { !self.signs } else { self.signs };
        (flipped & ((1 << edge) - 1)).count_ones()
    }
}

/// A vertex with its index in the mesh.
#[derive(Clone, Copy)]
struct IndexedVertex {
    index: u32,
    position: Vec3,
}

/// Appends the triangles of one tetrahedron of a cell. `crossing(a, b)` gives the vertex on the
/// edge between two corners of the cell.
fn add_tetrahedron_triangles(
    tetrahedron: &Tetrahedron,
    signs: u8,
    triangles: &mut Vec<[u32; 3]>,
    crossing: impl Fn(u8, u8) -> IndexedVertex,
) {
    let corners = tetrahedron.corners;
    let (mut order, mut inside) = ([0usize; 4], 0);
    for i in (0..4).filter(|&i| signs >> corners[i] & 1 == 1) {
        order[inside] = i;
        inside += 1;
    }
    for (end, i) in (inside..).zip((0..4).filter(|&i| signs >> corners[i] & 1 == 0)) {
        order[end] = i;
    }
    // Inside corners come first. An odd permutation of the corners inverts the orientation.
    let inversions =
        (0..4).flat_map(|i| (0..i).map(move |j| (j, i))).filter(|&(j, i)| order[j] > order[i]);
    let positive = tetrahedron.positive == (inversions.count() % 2 == 0);
    let [a, b, c, d] = order.map(|i| corners[i]);
    match inside {
        1 => push_oriented(triangles, positive, [crossing(a, b), crossing(a, c), crossing(a, d)]),
        2 => {
            let quad = [crossing(a, c), crossing(a, d), crossing(b, d), crossing(b, c)];
            for half in split_quad(quad) {
                push_oriented(triangles, positive, half);
            }
        }
        3 => push_oriented(triangles, positive, [crossing(a, d), crossing(b, d), crossing(c, d)]),
        _ => {}
    }
}

/// Appends a triangle, inverted unless `positive`.
fn push_oriented(triangles: &mut Vec<[u32; 3]>, positive: bool, vertices: [IndexedVertex; 3]) {
    let [p, q, r] = vertices.map(|vertex| vertex.index);
    triangles.push(if positive { [p, q, r] } else { [p, r, q] });
}

/// Splits a quadrilateral along its shorter diagonal.
fn split_quad([p, q, r, s]: [IndexedVertex; 4]) -> [[IndexedVertex; 3]; 2] {
    let from_p = (p.position - r.position).norm_squared();
    let from_q = (q.position - s.position).norm_squared();
    if from_p <= from_q { [[p, q, r], [p, r, s]] } else { [[p, q, s], [q, r, s]] }
}

#[cfg(test)]
#[path = "isosurface_tests.rs"]
pub(crate) mod tests;
