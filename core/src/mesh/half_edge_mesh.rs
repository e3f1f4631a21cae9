//! Half-edge structure of a closed, oriented, two-manifold triangle mesh, with the edits that keep
//! it so.
//!
//! Half-edge `h = 3 t + k` of triangle `t` runs from its corner `k` to its corner `k + 1`. The
//! half-edge that runs in the opposite direction in the adjacent triangle is its twin. Triangles
//! and vertices that an edit removes remain as gaps until [`HalfEdgeMesh::into_mesh`] closes them,
//! so that indices stay valid.

use super::Mesh;
use crate::geometry::Vec3;
use crate::{Error, Result};
use rustc_hash::FxHashMap;

/// Marks removed triangles and vertices.
const NO_INDEX: u32 = u32::MAX;

/// A closed triangle mesh that can be edited.
#[derive(Clone)]
pub struct HalfEdgeMesh {
    /// Vertex positions, metres; change them freely.
    pub positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    twins: Vec<u32>,
    /// Some half-edge that starts at each vertex; `NONE` for a removed one.
    outgoing: Vec<u32>,
}

impl HalfEdgeMesh {
    /// Links the half-edges of `mesh`.
    ///
    /// # Errors
    /// [`Error::Input`] if an edge does not have exactly two triangles that run along it in
    /// opposite directions, or if the triangles of a vertex do not form one fan, or if a vertex has
    /// no triangle.
    pub fn new(mesh: &Mesh) -> Result<HalfEdgeMesh> {
        let mut sides: FxHashMap<(u32, u32), u32> = FxHashMap::default();
        let mut outgoing = vec![NO_INDEX; mesh.vertices.len()];
        for (t, triangle) in mesh.triangles.iter().enumerate() {
            for k in 0..3 {
                let (from, to) = (triangle[k], triangle[(k + 1) % 3]);
                outgoing[from as usize] = (3 * t + k) as u32;
                if sides.insert((from, to), (3 * t + k) as u32).is_some() {
                    return Err(not_manifold(format!(
                        "edge {from}-{to} is run twice in the same direction"
                    )));
                }
            }
        }
        let mut twins = vec![NO_INDEX; 3 * mesh.triangles.len()];
        for (&(from, to), &half) in &sides {
            twins[half as usize] = *sides
                .get(&(to, from))
                .ok_or_else(|| not_manifold(format!("edge {from}-{to} has one triangle")))?;
        }
        let linked = HalfEdgeMesh {
            positions: mesh.vertices.clone(),
            triangles: mesh.triangles.clone(),
            twins,
            outgoing,
        };
        let mut degree = vec![0; mesh.vertices.len()];
        mesh.triangles.iter().flatten().for_each(|&v| degree[v as usize] += 1);
        match (0..degree.len())
            .find(|&v| degree[v] == 0 || linked.outgoing_half_edges(v as u32).count() != degree[v])
        {
            Some(v) => {
                Err(not_manifold(format!("the triangles of vertex {v} do not form one fan")))
            }
            None => Ok(linked),
        }
    }

    /// The mesh without the gaps that edits left; vertices keep their order. Attributes are not
    /// carried.
    pub fn into_mesh(self) -> Mesh {
        let mut new_index = vec![NO_INDEX; self.positions.len()];
        let mut vertices = Vec::new();
        for (v, half) in self.outgoing.iter().enumerate() {
            if *half != NO_INDEX {
                new_index[v] = vertices.len() as u32;
                vertices.push(self.positions[v]);
            }
        }
        let alive = self.triangles.iter().filter(|t| t[0] != NO_INDEX);
        let triangles = alive.map(|t| t.map(|v| new_index[v as usize])).collect();
        Mesh::new(vertices, triangles)
    }

    /// The mesh without the gaps that edits left; vertices and triangles keep their order.
    pub fn compacted(self) -> HalfEdgeMesh {
        let vertex_of = number_kept(self.outgoing.iter().map(|half| *half != NO_INDEX));
        let triangle_of = number_kept(self.triangles.iter().map(|t| t[0] != NO_INDEX));
        let vertices = (0..self.positions.len()).filter(|&v| vertex_of[v] != NO_INDEX);
        let (positions, outgoing) = vertices
            .map(|v| (self.positions[v], renumber_half_edge(self.outgoing[v], &triangle_of)))
            .unzip();
        let triangles = (0..self.triangles.len()).filter(|&t| triangle_of[t] != NO_INDEX);
        let triangles = triangles.map(|t| self.triangles[t].map(|v| vertex_of[v as usize]));
        let half_edges = (0..self.twins.len()).filter(|&h| triangle_of[h / 3] != NO_INDEX);
        let twins = half_edges.map(|h| renumber_half_edge(self.twins[h], &triangle_of));
        HalfEdgeMesh { positions, outgoing, triangles: triangles.collect(), twins: twins.collect() }
    }

    /// The current triangles with all positions, so that vertex indices agree with those of this
    /// structure.
    pub fn to_mesh(&self) -> Mesh {
        let alive = self.triangles.iter().filter(|t| t[0] != NO_INDEX);
        Mesh::new(self.positions.clone(), alive.copied().collect())
    }

    /// Number of half-edges, including those of removed triangles.
    pub fn half_edge_count(&self) -> u32 {
        self.twins.len() as u32
    }

    /// Whether the triangle of half-edge `h` was not removed.
    pub fn is_alive(&self, h: u32) -> bool {
        self.triangles[h as usize / 3][0] != NO_INDEX
    }

    /// Whether vertex `v` was not removed.
    pub fn is_vertex_alive(&self, v: u32) -> bool {
        self.outgoing[v as usize] != NO_INDEX
    }

    /// The vertex at which half-edge `h` starts.
    pub fn from_vertex(&self, h: u32) -> u32 {
        self.triangles[h as usize / 3][h as usize % 3]
    }

    /// The vertex at which half-edge `h` ends.
    pub fn to_vertex(&self, h: u32) -> u32 {
        self.from_vertex(next(h))
    }

    /// The half-edge that runs in the opposite direction.
    pub fn twin(&self, h: u32) -> u32 {
        self.twins[h as usize]
    }

    /// The vertex of `h`'s triangle that is not on `h`.
    pub fn opposite_vertex(&self, h: u32) -> u32 {
        self.from_vertex(previous(h))
    }

    /// Length of the edge of `h`, metres.
    pub fn edge_length(&self, h: u32) -> f64 {
        (self.positions[self.to_vertex(h) as usize] - self.positions[self.from_vertex(h) as usize])
            .norm()
    }

    /// The half-edges that start at `v`, in the order around it.
    pub fn outgoing_half_edges(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        let start = self.outgoing[v as usize];
        let mut current = Some(start).filter(|h| *h != NO_INDEX);
        std::iter::from_fn(move || {
            let h = current?;
            let following = self.twins[previous(h) as usize];
            current = (following != start).then_some(following);
            Some(h)
        })
    }

    /// The neighbours of `v`, in the order around it.
    pub fn one_ring(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        self.outgoing_half_edges(v).map(|h| self.to_vertex(h))
    }

    /// Number of neighbours of `v`.
    pub fn valence(&self, v: u32) -> usize {
        self.outgoing_half_edges(v).count()
    }

    /// Normal of the triangle of `h` whose length is twice the triangle's area, square metres.
    pub fn doubled_area_vector(&self, h: u32) -> Vec3 {
        let [a, b, c] = self.triangles[h as usize / 3].map(|v| self.positions[v as usize]);
        (b - a).cross(&(c - a))
    }

    /// Splits the edge of `h` at `position` (metres); returns the new vertex.
    pub fn split_edge(&mut self, h: u32, position: Vec3) -> u32 {
        let new = self.positions.len() as u32;
        self.positions.push(position);
        self.outgoing.push(NO_INDEX);
        let twin = self.twin(h);
        let (h_outer, twin_outer) = (self.split_triangle(h, new), self.split_triangle(twin, new));
        // `h` now ends at the new vertex. The half-edge beyond it belongs to the new triangle; the
        // same holds for the twin.
        self.link(h, twin_outer);
        self.link(twin, h_outer);
        self.outgoing[new as usize] = h_outer;
        new
    }

    /// Splits the triangle of `h` by an edge from its apex to `new` on `h`. Returns the half-edge
    /// from `new` to the former end of `h`.
    fn split_triangle(&mut self, h: u32, new: u32) -> u32 {
        let (t, k) = (h as usize / 3, h as usize % 3);
        let (end, apex) = (self.to_vertex(h), self.opposite_vertex(h));
        let added = self.triangles.len() as u32;
        let side = self.twin(next(h));
        self.triangles[t][(k + 1) % 3] = new;
        self.triangles.push([new, end, apex]);
        self.twins.extend([NO_INDEX; 3]);
        self.link(3 * added + 1, side);
        self.link(next(h), 3 * added + 2);
        self.outgoing[end as usize] = 3 * added + 1;
        self.outgoing[apex as usize] = 3 * added + 2;
        3 * added
    }

    /// Makes two half-edges twins of each other.
    fn link(&mut self, a: u32, b: u32) {
        self.twins[a as usize] = b;
        self.twins[b as usize] = a;
    }

    /// Whether [`HalfEdgeMesh::flip_edge`] keeps the mesh two-manifold: the new edge must not exist
    /// yet and both ends must keep three neighbours.
    pub fn can_flip(&self, h: u32) -> bool {
        let (a, b) = (self.opposite_vertex(h), self.opposite_vertex(self.twin(h)));
        let (from, to) = (self.from_vertex(h), self.to_vertex(h));
        a != b
            && self.valence(from) > 3
            && self.valence(to) > 3
            && !self.one_ring(a).any(|neighbour| neighbour == b)
    }

    /// Flips the edge of `h`, so that it joins the two vertices opposite of it. The caller must
    /// check [`HalfEdgeMesh::can_flip`] before.
    pub fn flip_edge(&mut self, h: u32) {
        let twin = self.twin(h);
        let (from, to, a, b) = (
            self.from_vertex(h),
            self.to_vertex(h),
            self.opposite_vertex(h),
            self.opposite_vertex(twin),
        );
        let (h_next, h_previous) = (self.twin(next(h)), self.twin(previous(h)));
        let (t_next, t_previous) = (self.twin(next(twin)), self.twin(previous(twin)));
        let (first, second) = (h / 3, twin / 3);
        // Triangles (a, from, b) and (b, to, a): their first two sides are outer edges, the last
        // one is the shared edge.
        self.triangles[first as usize] = [a, from, b];
        self.triangles[second as usize] = [b, to, a];
        self.link(3 * first, h_previous);
        self.link(3 * first + 1, t_next);
        self.link(3 * second, t_previous);
        self.link(3 * second + 1, h_next);
        self.link(3 * first + 2, 3 * second + 2);
        self.outgoing[a as usize] = 3 * first;
        self.outgoing[from as usize] = 3 * first + 1;
        self.outgoing[b as usize] = 3 * second;
        self.outgoing[to as usize] = 3 * second + 1;
    }

    /// Whether [`HalfEdgeMesh::collapse_edge`] keeps the mesh two-manifold (link condition; Dey et
    /// al. 1999, Topology Preserving Edge Contraction): the ends share exactly the two opposite
    /// vertices, and no vertex is left with fewer than three neighbours.
    pub fn can_collapse(&self, h: u32) -> bool {
        let (from, to) = (self.from_vertex(h), self.to_vertex(h));
        let (a, b) = (self.opposite_vertex(h), self.opposite_vertex(self.twin(h)));
        let common = self.one_ring(from).filter(|v| self.one_ring(to).any(|w| w == *v)).count();
        a != b
            && common == 2
            && self.valence(a) > 3
            && self.valence(b) > 3
            && self.valence(from) + self.valence(to) > 6
    }

    /// Merges the start of `h` into its end, which moves to `position` (metres). The caller must
    /// check [`HalfEdgeMesh::can_collapse`] before.
    pub fn collapse_edge(&mut self, h: u32, position: Vec3) {
        let (from, to) = (self.from_vertex(h), self.to_vertex(h));
        let twin = self.twin(h);
        let spokes: Vec<u32> = self.outgoing_half_edges(from).collect();
        for spoke in spokes {
            self.triangles[spoke as usize / 3][spoke as usize % 3] = to;
        }
        for side in [h, twin] {
            let (ahead, behind) = (self.twin(next(side)), self.twin(previous(side)));
            let apex = self.opposite_vertex(side);
            self.link(ahead, behind);
            // `ahead` starts at the apex; `behind` starts at an end of the collapsed edge, which is
            // `to` by now.
            self.outgoing[apex as usize] = ahead;
            self.outgoing[to as usize] = behind;
        }
        for side in [h, twin] {
            self.triangles[side as usize / 3] = [NO_INDEX; 3];
        }
        self.outgoing[from as usize] = NO_INDEX;
        self.positions[to as usize] = position;
    }
}

/// The new number of a half-edge, given the new number of each triangle.
fn renumber_half_edge(h: u32, triangle_of: &[u32]) -> u32 {
    3 * triangle_of[h as usize / 3] + h % 3
}

/// Consecutive numbers for the items that are kept, [`NO_INDEX`] for the others.
fn number_kept(kept: impl Iterator<Item = bool>) -> Vec<u32> {
    let mut next = 0;
    kept.map(|kept| {
        let number = if kept { next } else { NO_INDEX };
        next += u32::from(kept);
        number
    })
    .collect()
}

/// The next half-edge of the same triangle.
fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// The previous half-edge of the same triangle.
fn previous(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

/// The error of a mesh that has no half-edge structure.
fn not_manifold(what: String) -> Error {
    Error::input(format!("the mesh is not a closed, oriented two-manifold: {what}"))
}

#[cfg(test)]
#[path = "half_edge_mesh_tests.rs"]
mod tests;
