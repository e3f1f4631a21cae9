//! Half-edges of a closed, oriented, two-manifold triangle mesh, and the edits that keep it so.
//!
//! Half-edge `h = 3 t + k` of triangle `t` runs from its corner `k` to its corner `k + 1`; the half-edge that
//! runs the other way in the neighbouring triangle is its twin. Triangles and vertices that an edit removes
//! stay as gaps until [`HalfEdgeMesh::into_mesh`] closes them, so that indices keep their meaning.

use super::Mesh;
use crate::geometry::Vec3;
use crate::{Error, Result};
use rustc_hash::FxHashMap;

const NONE: u32 = u32::MAX;

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
    /// [`Error::Input`] if an edge has not exactly two triangles that run it in opposite directions, or a
    /// vertex joins two fans or belongs to no triangle.
    pub fn new(mesh: &Mesh) -> Result<HalfEdgeMesh> {
        let mut sides: FxHashMap<(u32, u32), u32> = FxHashMap::default();
        let mut outgoing = vec![NONE; mesh.vertices.len()];
        for (t, triangle) in mesh.triangles.iter().enumerate() {
            for k in 0..3 {
                let (from, to) = (triangle[k], triangle[(k + 1) % 3]);
                outgoing[from as usize] = (3 * t + k) as u32;
                if sides.insert((from, to), (3 * t + k) as u32).is_some() {
                    return Err(open(format!(
                        "edge {from}-{to} is run twice in the same direction"
                    )));
                }
            }
        }
        let mut twins = vec![NONE; 3 * mesh.triangles.len()];
        for (&(from, to), &half) in &sides {
            twins[half as usize] = *sides
                .get(&(to, from))
                .ok_or_else(|| open(format!("edge {from}-{to} has one triangle")))?;
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
            .find(|&v| degree[v] == 0 || linked.ring(v as u32).count() != degree[v])
        {
            Some(v) => Err(open(format!("the triangles of vertex {v} do not form one fan"))),
            None => Ok(linked),
        }
    }

    /// The mesh without the gaps that edits left; vertices keep their order. Attributes are not carried.
    pub fn into_mesh(self) -> Mesh {
        let mut new_index = vec![NONE; self.positions.len()];
        let mut vertices = Vec::new();
        for (v, half) in self.outgoing.iter().enumerate() {
            if *half != NONE {
                new_index[v] = vertices.len() as u32;
                vertices.push(self.positions[v]);
            }
        }
        let alive = self.triangles.iter().filter(|t| t[0] != NONE);
        let triangles = alive.map(|t| t.map(|v| new_index[v as usize])).collect();
        Mesh::new(vertices, triangles)
    }

    /// The mesh without the gaps that edits left; vertices and triangles keep their order.
    pub fn compacted(self) -> HalfEdgeMesh {
        let vertex_of = numbered(self.outgoing.iter().map(|half| *half != NONE));
        let triangle_of = numbered(self.triangles.iter().map(|t| t[0] != NONE));
        let half_of = |h: u32| 3 * triangle_of[h as usize / 3] + h % 3;
        let kept = |t: usize| triangle_of[t] != NONE;
        let vertices = (0..self.positions.len()).filter(|&v| vertex_of[v] != NONE);
        let (positions, outgoing) =
            vertices.map(|v| (self.positions[v], half_of(self.outgoing[v]))).unzip();
        let triangles = (0..self.triangles.len()).filter(|&t| kept(t));
        let triangles = triangles.map(|t| self.triangles[t].map(|v| vertex_of[v as usize]));
        let halves = (0..self.twins.len()).filter(|&h| kept(h / 3));
        HalfEdgeMesh {
            positions,
            outgoing,
            triangles: triangles.collect(),
            twins: halves.map(|h| half_of(self.twins[h])).collect(),
        }
    }

    /// The triangles as they stand, with all positions, so that vertex indices agree with those here.
    pub fn snapshot(&self) -> Mesh {
        let alive = self.triangles.iter().filter(|t| t[0] != NONE);
        Mesh::new(self.positions.clone(), alive.copied().collect())
    }

    /// Number of half-edges, those of removed triangles included.
    pub fn half_edges(&self) -> u32 {
        self.twins.len() as u32
    }

    /// Whether the triangle of half-edge `h` was not removed.
    pub fn is_alive(&self, h: u32) -> bool {
        self.triangles[h as usize / 3][0] != NONE
    }

    /// Whether vertex `v` was not removed.
    pub fn is_vertex(&self, v: u32) -> bool {
        self.outgoing[v as usize] != NONE
    }

    /// Vertex that half-edge `h` starts at.
    pub fn from(&self, h: u32) -> u32 {
        self.triangles[h as usize / 3][h as usize % 3]
    }

    /// Vertex that half-edge `h` ends at.
    pub fn to(&self, h: u32) -> u32 {
        self.from(next(h))
    }

    /// The half-edge that runs the other way.
    pub fn twin(&self, h: u32) -> u32 {
        self.twins[h as usize]
    }

    /// The vertex of `h`'s triangle that is not on `h`.
    pub fn apex(&self, h: u32) -> u32 {
        self.from(previous(h))
    }

    /// Length of `h`, metres.
    pub fn length(&self, h: u32) -> f64 {
        (self.positions[self.to(h) as usize] - self.positions[self.from(h) as usize]).norm()
    }

    /// The half-edges that start at `v`, in turn.
    pub fn ring(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        let start = self.outgoing[v as usize];
        let mut current = Some(start).filter(|h| *h != NONE);
        std::iter::from_fn(move || {
            let h = current?;
            let following = self.twins[previous(h) as usize];
            current = (following != start).then_some(following);
            Some(h)
        })
    }

    /// The neighbours of `v`, in turn.
    pub fn neighbours(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        self.ring(v).map(|h| self.to(h))
    }

    /// Number of neighbours of `v`.
    pub fn valence(&self, v: u32) -> usize {
        self.ring(v).count()
    }

    /// Doubled area vector of the triangle of `h`, square metres.
    pub fn area_vector(&self, h: u32) -> Vec3 {
        let [a, b, c] = self.triangles[h as usize / 3].map(|v| self.positions[v as usize]);
        (b - a).cross(&(c - a))
    }

    /// Cuts the edge of `h` in two at `position`; returns the new vertex.
    pub fn split(&mut self, h: u32, position: Vec3) -> u32 {
        let new = self.positions.len() as u32;
        self.positions.push(position);
        self.outgoing.push(NONE);
        let twin = self.twin(h);
        let (h_outer, twin_outer) = (self.cut(h, new), self.cut(twin, new));
        // `h` now ends at the new vertex; what lies beyond it is the new triangle's side, and the same for twin.
        self.link(h, twin_outer);
        self.link(twin, h_outer);
        self.outgoing[new as usize] = h_outer;
        new
    }

    /// Cuts the triangle of `h` from its apex to `new` on `h`; the half-edge from `new` to the old end of `h`.
    fn cut(&mut self, h: u32, new: u32) -> u32 {
        let (t, k) = (h as usize / 3, h as usize % 3);
        let (end, apex) = (self.to(h), self.apex(h));
        let added = self.triangles.len() as u32;
        let side = self.twin(next(h));
        self.triangles[t][(k + 1) % 3] = new;
        self.triangles.push([new, end, apex]);
        self.twins.extend([NONE; 3]);
        self.link(3 * added + 1, side);
        self.link(next(h), 3 * added + 2);
        self.outgoing[end as usize] = 3 * added + 1;
        self.outgoing[apex as usize] = 3 * added + 2;
        3 * added
    }

    fn link(&mut self, a: u32, b: u32) {
        self.twins[a as usize] = b;
        self.twins[b as usize] = a;
    }

    /// Whether [`HalfEdgeMesh::flip`] keeps the mesh two-manifold: the new edge must not exist yet and both ends
    /// must keep three neighbours.
    pub fn can_flip(&self, h: u32) -> bool {
        let (a, b) = (self.apex(h), self.apex(self.twin(h)));
        let (from, to) = (self.from(h), self.to(h));
        a != b
            && self.valence(from) > 3
            && self.valence(to) > 3
            && !self.neighbours(a).any(|neighbour| neighbour == b)
    }

    /// Turns the edge of `h` so that it joins the two vertices opposite of it. Ask [`HalfEdgeMesh::can_flip`].
    pub fn flip(&mut self, h: u32) {
        let twin = self.twin(h);
        let (from, to, a, b) = (self.from(h), self.to(h), self.apex(h), self.apex(twin));
        let (h_next, h_previous) = (self.twin(next(h)), self.twin(previous(h)));
        let (t_next, t_previous) = (self.twin(next(twin)), self.twin(previous(twin)));
        let (first, second) = (h / 3, twin / 3);
        // Triangles (a, from, b) and (b, to, a); their first sides are outer ones, the last is the shared edge.
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

    /// Whether [`HalfEdgeMesh::collapse`] keeps the mesh two-manifold (link condition; Dey et al. 1999): its ends
    /// share exactly the two opposite vertices, and nobody is left with fewer than three neighbours.
    pub fn can_collapse(&self, h: u32) -> bool {
        let (from, to) = (self.from(h), self.to(h));
        let (a, b) = (self.apex(h), self.apex(self.twin(h)));
        let common = self.neighbours(from).filter(|v| self.neighbours(to).any(|w| w == *v)).count();
        a != b
            && common == 2
            && self.valence(a) > 3
            && self.valence(b) > 3
            && self.valence(from) + self.valence(to) > 6
    }

    /// Merges the start of `h` into its end, which moves to `position`. Ask [`HalfEdgeMesh::can_collapse`].
    pub fn collapse(&mut self, h: u32, position: Vec3) {
        let (from, to) = (self.from(h), self.to(h));
        let twin = self.twin(h);
        let ring: Vec<u32> = self.ring(from).collect();
        for &spoke in &ring {
            self.triangles[spoke as usize / 3][spoke as usize % 3] = to;
        }
        for side in [h, twin] {
            let (ahead, behind) = (self.twin(next(side)), self.twin(previous(side)));
            let apex = self.apex(side);
            self.link(ahead, behind);
            // `ahead` starts at the apex; `behind` at the vertex that `side` starts or ends at: `to`, by now.
            self.outgoing[apex as usize] = ahead;
            self.outgoing[to as usize] = behind;
        }
        for side in [h, twin] {
            self.triangles[side as usize / 3] = [NONE; 3];
        }
        self.outgoing[from as usize] = NONE;
        self.positions[to as usize] = position;
    }
}

/// Consecutive numbers for what is kept, [`NONE`] for the rest.
fn numbered(kept: impl Iterator<Item = bool>) -> Vec<u32> {
    let mut next = 0;
    kept.map(|kept| {
        let number = if kept { next } else { NONE };
        next += u32::from(kept);
        number
    })
    .collect()
}

fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

fn previous(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

fn open(what: String) -> Error {
    Error::input(format!("the mesh is not a closed, oriented two-manifold: {what}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{genus, is_closed, is_oriented, is_two_manifold, test_shapes};

    fn assert_sound(mesh: &HalfEdgeMesh, expected_genus: i64) {
        for h in (0..mesh.half_edges()).filter(|h| mesh.is_alive(*h)) {
            assert_eq!(mesh.twin(mesh.twin(h)), h);
            assert_eq!(
                (mesh.from(h), mesh.to(h)),
                (mesh.to(mesh.twin(h)), mesh.from(mesh.twin(h)))
            );
            assert!(mesh.ring(mesh.from(h)).any(|spoke| spoke == h));
        }
        let plain = mesh.clone().into_mesh();
        assert!(is_closed(&plain) && is_two_manifold(&plain) && is_oriented(&plain));
        assert_eq!(genus(&plain), Some(expected_genus));
    }

    #[test]
    fn splits_flips_and_collapses_keep_the_mesh_sound() {
        for (shape, expected_genus) in
            [(test_shapes::sphere(1.0, 2), 0), (test_shapes::torus(1.0, 0.3, 12, 8), 1)]
        {
            let mut mesh = HalfEdgeMesh::new(&shape).unwrap();
            for h in (0..mesh.half_edges()).step_by(7) {
                let middle = (mesh.positions[mesh.from(h) as usize]
                    + mesh.positions[mesh.to(h) as usize])
                    / 2.0;
                mesh.split(h, middle);
            }
            assert_sound(&mesh, expected_genus);
            for h in (0..mesh.half_edges()).step_by(5).filter(|h| *h != NONE) {
                if mesh.can_flip(h) {
                    mesh.flip(h);
                }
            }
            assert_sound(&mesh, expected_genus);
            let mut collapsed = 0;
            for h in (0..mesh.half_edges()).step_by(3) {
                if mesh.is_alive(h) && mesh.can_collapse(h) {
                    let position = mesh.positions[mesh.to(h) as usize];
                    mesh.collapse(h, position);
                    collapsed += 1;
                }
            }
            assert!(collapsed > 20);
            assert_sound(&mesh, expected_genus);
        }
    }

    #[test]
    fn closing_the_gaps_changes_nothing_but_numbers() {
        let mut mesh = HalfEdgeMesh::new(&test_shapes::torus(1.0, 0.4, 20, 10)).unwrap();
        for h in (0..mesh.half_edges()).step_by(7) {
            if mesh.is_alive(h) && mesh.can_collapse(h) {
                mesh.collapse(h, mesh.positions[mesh.from(h) as usize]);
            }
        }
        let compacted = mesh.clone().compacted();
        assert!(compacted.positions.len() < mesh.positions.len());
        assert!(compacted.half_edges() < mesh.half_edges());
        assert_sound(&compacted, 1);
        assert_eq!(compacted.into_mesh(), mesh.into_mesh());
    }

    #[test]
    fn everything_collapses_at_most_to_a_tetrahedron() {
        let mut mesh = HalfEdgeMesh::new(&test_shapes::sphere(1.0, 2)).unwrap();
        for _ in 0..50 {
            for h in 0..mesh.half_edges() {
                if mesh.is_alive(h) && mesh.can_collapse(h) {
                    let position = mesh.positions[mesh.to(h) as usize];
                    mesh.collapse(h, position);
                }
            }
        }
        assert_sound(&mesh, 0);
        assert_eq!(mesh.into_mesh().triangles.len(), 4);
    }

    #[test]
    fn an_open_or_twisted_mesh_is_refused() {
        let mut mesh = test_shapes::sphere(1.0, 1);
        mesh.triangles.pop();
        assert!(HalfEdgeMesh::new(&mesh).err().unwrap().to_string().contains("one triangle"));
        let mut mesh = test_shapes::sphere(1.0, 1);
        mesh.triangles[3].swap(0, 1);
        assert!(HalfEdgeMesh::new(&mesh).is_err());
    }
}
