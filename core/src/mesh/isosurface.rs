//! The zero level set of a field on a lattice, by marching tetrahedra.
//!
//! Each cube is cut into the six tetrahedra of Kuhn round its diagonal from corner 000 to corner 111
//! (Doi and Koide 1991, IEICE Trans. E74). The tetrahedra fit together face to face and each holds one flat
//! triangle or one pair of triangles, so the surface is two-manifold and free of self-intersections by
//! construction, whatever the values are; a layer of outside corners round the lattice closes it.

use super::Mesh;
use crate::geometry::{Aabb, Vec3};
use rayon::prelude::*;

/// Crossings keep this distance from the corners, in edge lengths, so that no triangle degenerates.
const MARGIN: f64 = 0.05;

/// Corners 1 to 3 of each tetrahedron between corner 0 and corner 7 (bit 0: x, bit 1: y, bit 2: z), and
/// whether it is positively oriented: the permutations of the axes and their parity.
const TETRAHEDRA: [([u8; 4], bool); 6] = [
    ([0, 1, 3, 7], true),
    ([0, 1, 5, 7], false),
    ([0, 2, 6, 7], true),
    ([0, 2, 3, 7], false),
    ([0, 4, 5, 7], true),
    ([0, 4, 6, 7], false),
];

/// A scalar field on the corners of a regular lattice; negative is inside.
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

    /// The zero level set as a closed, two-manifold mesh without self-intersections, oriented outwards;
    /// empty if no corner is inside. Everything beyond the lattice is outside. Vertices stand in the
    /// order of the lattice. Time and memory grow with the crossed cells, but for one sweep of the corners.
    pub fn surface(&self) -> Mesh {
        if self.size.contains(&0) {
            return Mesh::default();
        }
        let layers: Vec<Layer> =
            (0..=self.size[2]).into_par_iter().map(|z| self.crossings(z)).collect();
        let mut firsts = vec![0usize];
        for layer in &layers {
            firsts.push(firsts[firsts.len() - 1] + layer.vertices.len());
        }
        let triangles: Vec<Vec<[u32; 3]>> = (0..layers.len())
            .into_par_iter()
            .map(|z| self.triangles(&layers, &firsts, z))
            .collect();
        let vertices = layers.into_iter().flat_map(|layer| layer.vertices).collect();
        Mesh::new(vertices, triangles.concat())
    }

    /// Value at a corner of the padded lattice, whose corner (1, 1, 1) is this one's (0, 0, 0).
    fn padded(&self, corner: [usize; 3]) -> f64 {
        if (0..3).all(|i| (1..=self.size[i]).contains(&corner[i])) {
            self.values[self.index(corner[0] - 1, corner[1] - 1, corner[2] - 1)].into()
        } else {
            self.spacing
        }
    }

    /// Which corners of layer `z` of the padded lattice are inside, x fastest.
    fn inside(&self, z: usize) -> Vec<bool> {
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

    /// All crossed cells of layer `z` of the padded lattice and the vertices on the edges that leave their
    /// corner 000. A cell is crossed exactly if one of these seven edges is.
    fn crossings(&self, z: usize) -> Layer {
        let (row, rows) = (self.size[0] + 2, self.size[1] + 2);
        let planes = [self.inside(z), self.inside(z + 1)];
        let mut layer = Layer::default();
        for y in 0..rows - 1 {
            for x in 0..row - 1 {
                let inside = |c: usize| planes[c >> 2][(y + (c >> 1 & 1)) * row + x + (c & 1)];
                let signs = (0..8).fold(0u8, |signs, c| signs | u8::from(inside(c)) << c);
                if signs == 0 || signs == 255 {
                    continue;
                }
                let first = layer.vertices.len() as u32;
                for c in (1..8).filter(|c| (signs >> c & 1) != (signs & 1)) {
                    layer.vertices.push(self.vertex([x, y, z], c));
                }
                layer.cells.push(Cell { corner: (y * row + x) as u32, signs, first });
            }
        }
        layer
    }

    /// The zero on the edge from padded corner `from` to corner `c` of its cell.
    fn vertex(&self, from: [usize; 3], c: usize) -> Vec3 {
        let step = [c & 1, c >> 1 & 1, c >> 2];
        let (a, b) = (self.padded(from), self.padded(std::array::from_fn(|i| from[i] + step[i])));
        let t = a / (a - b);
        let t = if t.is_finite() { t.clamp(MARGIN, 1.0 - MARGIN) } else { 0.5 };
        let along = |i: usize| from[i] as f64 - 1.0 + t * step[i] as f64;
        self.origin + Vec3::new(along(0), along(1), along(2)) * self.spacing
    }

    /// The triangles of the cells of layer `z`; `firsts` holds each layer's first vertex.
    fn triangles(&self, layers: &[Layer], firsts: &[usize], z: usize) -> Vec<[u32; 3]> {
        let row = self.size[0] + 2;
        let plane = row * (self.size[1] + 2);
        let tables = [layers[z].table(plane), layers.get(z + 1).map_or(vec![], |l| l.table(plane))];
        let mut triangles = Vec::with_capacity(2 * layers[z].vertices.len());
        for cell in &layers[z].cells {
            let vertex = |a: u8, b: u8| {
                let (low, edge) = (a.min(b), a ^ b);
                let above = usize::from(low >> 2);
                let corner =
                    cell.corner as usize + usize::from(low & 1) + usize::from(low >> 1 & 1) * row;
                let owner = &layers[z + above].cells[tables[above][corner] as usize];
                let id = firsts[z + above] + (owner.first + owner.rank(edge)) as usize;
                (id as u32, layers[z + above].vertices[id - firsts[z + above]])
            };
            for (corners, positive) in TETRAHEDRA {
                cut(corners, positive, cell.signs, vertex, &mut triangles);
            }
        }
        triangles
    }
}

/// The crossed cells of one layer of cells, in lattice order.
#[derive(Default)]
struct Layer {
    cells: Vec<Cell>,
    vertices: Vec<Vec3>,
}

impl Layer {
    /// For each corner of the plane the index of the crossed cell that has it as corner 000.
    fn table(&self, plane: usize) -> Vec<u32> {
        let mut table = vec![u32::MAX; plane];
        for (i, cell) in self.cells.iter().enumerate() {
            table[cell.corner as usize] = i as u32;
        }
        table
    }
}

/// A crossed cell: its corner 000 in its plane, which of the eight corners are inside, its first vertex.
struct Cell {
    corner: u32,
    signs: u8,
    first: u32,
}

impl Cell {
    /// Number of crossed edges from corner 000 that come before the one to corner `edge`.
    fn rank(&self, edge: u8) -> u32 {
        let flipped = if self.signs & 1 == 1 { !self.signs } else { self.signs };
        (flipped & ((1 << edge) - 1)).count_ones()
    }
}

/// Appends the triangles of one tetrahedron. `vertex(a, b)` gives index and position of the zero between
/// two corners of the cell.
fn cut(
    corners: [u8; 4],
    positive: bool,
    signs: u8,
    vertex: impl Fn(u8, u8) -> (u32, Vec3),
    triangles: &mut Vec<[u32; 3]>,
) {
    let (mut order, mut inside) = ([0usize; 4], 0);
    for i in (0..4).filter(|&i| signs >> corners[i] & 1 == 1) {
        order[inside] = i;
        inside += 1;
    }
    for (end, i) in (inside..).zip((0..4).filter(|&i| signs >> corners[i] & 1 == 0)) {
        order[end] = i;
    }
    // Inside corners first: reordering by an odd permutation turns the tetrahedron's orientation over.
    let inversions =
        (0..4).flat_map(|i| (0..i).map(move |j| (j, i))).filter(|&(j, i)| order[j] > order[i]);
    let positive = positive == (inversions.count() % 2 == 0);
    let [a, b, c, d] = order.map(|i| corners[i]);
    let mut push = |p: u32, q: u32, r: u32| {
        triangles.push(if positive { [p, q, r] } else { [p, r, q] });
    };
    match inside {
        1 => push(vertex(a, b).0, vertex(a, c).0, vertex(a, d).0),
        2 => {
            let quad = [vertex(a, c), vertex(a, d), vertex(b, d), vertex(b, c)];
            let [p, q, r, s] = quad.map(|v| v.0);
            let diagonal = |i: usize| (quad[i].1 - quad[i + 2].1).norm_squared();
            if diagonal(0) <= diagonal(1) {
                push(p, q, r);
                push(p, r, s);
            } else {
                push(p, q, s);
                push(q, r, s);
            }
        }
        3 => push(vertex(a, d).0, vertex(b, d).0, vertex(c, d).0),
        _ => {}
    }
}

#[cfg(test)]
#[path = "isosurface_tests.rs"]
pub(crate) mod tests;
