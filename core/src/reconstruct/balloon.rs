//! The thesis's inflation (Wiedemann 2014, §2.4.2): a tetrahedron in one voxel of the inside space grows until no
//! vertex can move safely. What is ours is marked so, with the reason.

use super::guard::{edit_guarded, move_guarded};
use super::shape::umbrella;
use crate::geometry::{Aabb, Cloud, Surface, Vec3};
use crate::mesh::remesh::{remesh, vertex_normals};
use crate::mesh::{HalfEdgeMesh, Mesh};
use crate::voxel::{Voxel, VoxelSpace, voxel_center};
use crate::{Error, Progress, Result};
use rayon::prelude::*;

/// Share `k` of the free way that a vertex moves at once (the thesis asks for k < 1).
const STEP: f64 = 0.5;
/// Distance within which inside voxels decide a vertex's direction, in voxel edges.
const NEIGHBOURHOOD: i32 = 2;
/// Steps at most: ten times what the longest way across the box needs.
const SLACK: f64 = 10.0;
/// Edge length of the mesh in voxel edges: edges longer than 4/3 of it, the thesis's 2 l, are split.
const EDGE: f64 = 1.5;
/// Share of the umbrella displacement by which the mesh relaxes at each step.
const RELAX: f64 = 0.5;
/// Inflation ends when the volume has grown by less than this share in [`PATIENCE`] steps.
const LEAST_GROWTH: f64 = 2e-4;
const PATIENCE: usize = 6;
/// Directions of the 26 that may escape from a seed: a side and its edges, which the object stood on, are nine.
const ESCAPES: usize = 9;

struct Spaces {
    edge: f64,
    /// Voxels that hold a point.
    surface: VoxelSpace<bool>,
    /// Voxels that the mesh passed or passes.
    inside: VoxelSpace<bool>,
    reach: f64,
}

/// What the beam from a vertex says.
enum Beam {
    /// The vertex can move by this way, metres.
    Safe(f64),
    /// The surface, or another front of the mesh, is within reach of half a voxel.
    Arrived,
    /// It points into the mesh.
    Inwards,
    /// It meets no surface.
    Escapes,
}

/// The mesh of a step, and what is asked of it for every vertex.
struct Front {
    own: Surface,
    snapshot: Mesh,
    normals: Vec<Vec3>,
    spread: Vec<Vec3>,
}

/// The inflated mesh in voxels of edge `edge` (metres).
///
/// # Errors
/// [`Error::Input`] if no voxel is enclosed by the points; [`Error::Cancelled`].
pub(super) fn inflate(cloud: &Cloud, edge: f64, progress: &Progress) -> Result<Mesh> {
    let bounds = Aabb::of(&cloud.points);
    let mut spaces = Spaces::new(cloud, &bounds, edge);
    let (seed, depth) = spaces.seed(&bounds).ok_or_else(|| {
        Error::input(
            "no voxel is enclosed by the points: scan more sides, or use reconstruct.inflate = field, which \
             closes holes",
        )
    })?;
    spaces.inside.set(seed, true);
    // The seed's voxel is fully inside a tetrahedron with corners 1.5 voxels out; where less room is, a smaller one.
    let mut mesh =
        HalfEdgeMesh::new(&tetrahedron(&voxel_center(seed, edge), (1.55 * edge).min(0.3 * depth)))?;
    let most = (SLACK * bounds.diagonal() / edge) as usize;
    let mut volumes = Vec::new();
    for step in 0..most {
        progress.report("inflate", step as f64 / (step as f64 + 100.0))?;
        let snapshot = mesh.snapshot();
        spaces.fill(&snapshot);
        volumes.push(snapshot.volume());
        let grown = |before: &f64| volumes[step] > (1.0 + LEAST_GROWTH) * before;
        // Ours: relaxing and pushing balance where nothing more can be won; waiting for the last vertex is in vain.
        if step >= PATIENCE && !grown(&volumes[step - PATIENCE]) {
            break;
        }
        let (targets, moved) = spaces.targets(&mesh, snapshot)?;
        if moved == 0 {
            break;
        }
        move_guarded(&mut mesh, &targets);
        // Ours: besides the thesis's splits, short edges collapse and obtuse ones flip. Splits alone pile up slivers,
        // whose beams meet their own neighbours and whose moves cut the mesh: it can get stuck half-way.
        edit_guarded(&mut mesh, |mesh, frozen| remesh(mesh, EDGE * edge, frozen));
    }
    Ok(mesh.into_mesh())
}

/// A regular tetrahedron round `center`, at four corners of a cube of half side `half` (metres).
fn tetrahedron(center: &Vec3, half: f64) -> Mesh {
    let corners = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    let vertices = corners.map(|c| center + Vec3::from(c) * half).to_vec();
    Mesh::new(vertices, vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
}

impl Spaces {
    fn new(cloud: &Cloud, bounds: &Aabb, edge: f64) -> Spaces {
        let mut surface = VoxelSpace::new(edge);
        for point in &cloud.points {
            let voxel = surface.voxel_of(point);
            surface.set(voxel, true);
        }
        Spaces { edge, surface, inside: VoxelSpace::new(edge), reach: bounds.diagonal() + edge }
    }

    /// The voxel that surface encloses in the most of the 26 directions, among these the one farthest from it, and
    /// that distance (metres). Ours: where the seed stands.
    fn seed(&self, bounds: &Aabb) -> Option<(Voxel, f64)> {
        let (low, high) = (self.surface.voxel_of(&bounds.min), self.surface.voxel_of(&bounds.max));
        // A coarser grid finds the deepest place as well, and tries a thousandth of the voxels.
        let stride = ((high[0] - low[0]).max(high[1] - low[1]).max(high[2] - low[2]) / 40).max(1);
        let along = |i: usize| (low[i]..=high[i]).step_by(stride as usize);
        let candidates: Vec<Voxel> = along(0)
            .flat_map(|x| along(1).flat_map(move |y| along(2).map(move |z| [x, y, z])))
            .collect();
        let found: Vec<(usize, f64)> = candidates.par_iter().map(|v| self.depth(*v)).collect();
        let best = (0..candidates.len())
            .filter(|&i| found[i].0 <= ESCAPES && found[i].1 > 0.0)
            .min_by(|&a, &b| {
                let (one, two) = (found[a], found[b]);
                one.0.cmp(&two.0).then(two.1.total_cmp(&one.1)).then(a.cmp(&b))
            })?;
        Some((candidates[best], found[best].1))
    }

    /// How many of the 26 directions escape, and the shortest distance to the surface over the others.
    fn depth(&self, voxel: Voxel) -> (usize, f64) {
        let center = voxel_center(voxel, self.edge);
        (0..27)
            .filter(|i| *i != 13)
            .map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1])
            .map(|d| Vec3::from_fn(|i, _| f64::from(d[i])).normalize())
            .map(|d| self.to_surface(&center, &d))
            .fold((0, f64::INFINITY), |(escapes, depth), way| match way {
                Some(way) => (escapes, depth.min(way)),
                None => (escapes + 1, depth),
            })
    }

    fn to_surface(&self, from: &Vec3, direction: &Vec3) -> Option<f64> {
        self.surface.first_on_ray(from, direction, self.reach, |occupied| occupied).map(|(_, d)| d)
    }

    /// Marks the voxels that triangles of `mesh` touch, by points half a voxel apart.
    fn fill(&mut self, mesh: &Mesh) {
        for t in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(t);
            let longest = (b - a).norm().max((c - a).norm()).max((c - b).norm());
            let n = (longest / (0.5 * self.edge)).ceil().max(1.0) as usize;
            for i in 0..=n {
                for j in 0..=n - i {
                    let point =
                        a + (b - a) * (i as f64 / n as f64) + (c - a) * (j as f64 / n as f64);
                    let voxel = self.inside.voxel_of(&point);
                    self.inside.set(voxel, true);
                }
            }
        }
    }

    /// Where each vertex goes, and how many of them move safely.
    fn targets(&self, mesh: &HalfEdgeMesh, snapshot: Mesh) -> Result<(Vec<Vec3>, usize)> {
        let front = Front {
            own: Surface::new(&snapshot.vertices, &snapshot.triangles)?,
            snapshot,
            normals: vertex_normals(mesh),
            spread: umbrella(mesh),
        };
        let moves: Vec<(Vec3, bool)> = (0..mesh.positions.len())
            .into_par_iter()
            .map(|v| {
                if mesh.is_vertex(v as u32) { self.step(&front, v) } else { (Vec3::zeros(), false) }
            })
            .collect();
        let moved = moves.iter().filter(|m| m.1).count();
        Ok((mesh.positions.iter().zip(moves).map(|(p, m)| p + m.0).collect(), moved))
    }

    /// The displacement of vertex `v`, and whether it is a safe move.
    fn step(&self, front: &Front, v: usize) -> (Vec3, bool) {
        let (vertex, normal) = (front.snapshot.vertices[v], front.normals[v]);
        let direction = self.direction(&vertex);
        let mut way = direction.unwrap_or(normal);
        let mut beam = self.beam(front, &vertex, &normal, &way);
        if matches!(beam, Beam::Inwards) {
            // Ours: in a fold or a narrow place the inside voxels lie all round and decide nothing; the normal does.
            way = normal;
            beam = self.beam(front, &vertex, &normal, &way);
        }
        // Ours: along the surface the vertices spread evenly, which keeps triangles well shaped.
        let tangential = (front.spread[v] - normal * front.spread[v].dot(&normal)) * RELAX;
        match beam {
            Beam::Safe(free) => (way * free + tangential, true),
            Beam::Arrived => (tangential, false),
            // Ours: a vertex that cannot move by itself follows its neighbours like a membrane, so that holes in the
            // points do not stop vertices one at a time and leave dents. It never crosses the surface.
            Beam::Inwards | Beam::Escapes => {
                let follow = front.spread[v] * RELAX;
                let length = follow.norm();
                let crosses = length > 0.0
                    && self
                        .to_surface(&vertex, &(follow / length))
                        .is_some_and(|d| d < length + 0.5 * self.edge);
                (if crosses { Vec3::zeros() } else { follow }, false)
            }
        }
    }

    /// What the beam from `vertex` along the unit vector `way` meets; the safe move is `k min(d_s, l)`.
    fn beam(&self, front: &Front, vertex: &Vec3, normal: &Vec3, way: &Vec3) -> Beam {
        if way.dot(normal) <= 0.0 {
            return Beam::Inwards;
        }
        let Some(mut free) = self.to_surface(vertex, way) else { return Beam::Escapes };
        // Ours: the beam starts a little above the vertex, clear of the vertex's own triangles.
        let start = vertex + normal * (0.05 * self.edge);
        if let Some((distance, triangle)) = front.own.cast_ray(&start, way, free) {
            // Ours: only a triangle met from behind means that the beam points inwards. One met from outside is another
            // front of the mesh, to which a way is free; the two fronts share it and keep a voxel between them.
            if front.snapshot.triangle_normal(triangle).dot(way) >= 0.0 {
                return Beam::Inwards;
            }
            free = free.min(0.5 * (distance - self.edge));
        }
        if free <= 0.5 * self.edge {
            return Beam::Arrived;
        }
        Beam::Safe(STEP * free.min(self.edge))
    }

    /// Normalised sum of the vectors from the centres of the inside voxels near `vertex` to it.
    fn direction(&self, vertex: &Vec3) -> Option<Vec3> {
        let center = self.inside.voxel_of(vertex);
        let mut sum = Vec3::zeros();
        for x in -NEIGHBOURHOOD..=NEIGHBOURHOOD {
            for y in -NEIGHBOURHOOD..=NEIGHBOURHOOD {
                for z in -NEIGHBOURHOOD..=NEIGHBOURHOOD {
                    let voxel = [center[0] + x, center[1] + y, center[2] + z];
                    if self.inside.get(voxel) {
                        sum += vertex - voxel_center(voxel, self.edge);
                    }
                }
            }
        }
        sum.try_normalize(1e-6 * self.edge)
    }
}
