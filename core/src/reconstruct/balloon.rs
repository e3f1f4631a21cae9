//! The inflation of the thesis (Wiedemann 2014, §2.4.1): a tetrahedron in one voxel of the inside
//! space grows until no vertex can move safely. Where the implementation departs from the thesis, a
//! comment says so and why.

use super::guard::{edit_guarded, move_guarded};
use super::smoothing::mean_neighbour_offsets;
use crate::geometry::{Aabb, Cloud, Surface, Vec3};
use crate::mesh::remeshing::{remesh, vertex_normals};
use crate::mesh::{HalfEdgeMesh, Mesh};
use crate::voxel::{Voxel, VoxelSpace, voxel_center};
use crate::{Error, Progress, Result};
use rayon::prelude::*;

/// Share `k` of the free way that a vertex moves in one step (the thesis asks for k < 1).
const STEP_RATIO: f64 = 0.5;
/// Distance within which inside voxels decide the direction of a vertex, in voxels.
const DIRECTION_REACH_VOXELS: i32 = 2;
/// Largest number of steps, in voxels of the box's diagonal: ten times what the longest way across
/// the box needs.
const MAX_STEPS_PER_VOXEL: f64 = 10.0;
/// Steps that are half of the inflation by the progress that is reported: their number is not
/// known.
const HALF_PROGRESS_STEPS: f64 = 100.0;
/// Edge length of the mesh in voxel edges: edges longer than 4/3 of it, the thesis's 2 l, are
/// split.
const EDGE_PER_VOXEL: f64 = 1.5;
/// Share of the way to the mean of its neighbours that a vertex relaxes by in one step.
const RELAXATION_RATIO: f64 = 0.5;
/// Inflation ends when the volume has grown by less than this share in [`GROWTH_STEPS`] steps.
const MIN_GROWTH: f64 = 2e-4;
/// Steps over which the growth of the volume is measured.
const GROWTH_STEPS: usize = 6;
/// Directions of the 26 that may escape from a seed: a side and its edges, on which the object
/// stood, are nine.
const MAX_ESCAPES: usize = 9;
/// Candidates for the seed along the longest side of the box: a coarser grid finds the deepest
/// place as well, and tries a thousandth of the voxels.
const SEED_CANDIDATES: i32 = 40;
/// Half side, in voxel edges, of the cube whose corners the first tetrahedron has: it then contains
/// the whole voxel of the seed.
const SEED_HALF_SIDE: f64 = 1.55;
/// Largest half side in distances from the seed to the surface, for objects that are narrower.
const MAX_SEED_HALF_SIDE_DEPTHS: f64 = 0.3;
/// Distance from the surface, in voxel edges, at which a vertex has arrived.
const ARRIVAL_VOXELS: f64 = 0.5;
/// Height above a vertex, in voxel edges, at which its beam starts, clear of the vertex's own
/// triangles.
const BEAM_START_VOXELS: f64 = 0.05;
/// Distance between the points that mark the voxels of a triangle, in voxel edges.
const FILL_SPACING_VOXELS: f64 = 0.5;
/// Least length of the sum of directions, in voxel edges, that is more than rounding.
const MIN_DIRECTION_VOXELS: f64 = 1e-6;

/// The voxels of the surface and those inside the mesh.
struct Spaces {
    /// Edge of a voxel, metres.
    edge: f64,
    /// Voxels that hold a point.
    surface: VoxelSpace<bool>,
    /// Voxels that the mesh passed or passes.
    inside: VoxelSpace<bool>,
    /// Length of a beam that leaves the box for certain, metres.
    reach: f64,
}

/// What the beam from a vertex meets.
enum Beam {
    /// The vertex can move by this distance, metres.
    Safe(f64),
    /// The surface, or another front of the mesh, is within half a voxel.
    Arrived,
    /// The beam points into the mesh.
    Inwards,
    /// The beam meets no surface.
    Escapes,
}

/// The mesh before a step, prepared for the queries of all vertices.
struct Front {
    /// Its triangles for searches.
    own: Surface,
    snapshot: Mesh,
    normals: Vec<Vec3>,
    /// Displacement of each vertex to the mean of its neighbours, metres.
    offsets: Vec<Vec3>,
}

/// Where a vertex goes.
struct Move {
    /// Metres.
    displacement: Vec3,
    /// Whether it is a safe move in the sense of the thesis.
    is_safe: bool,
}

impl Move {
    const NONE: Move = Move { displacement: Vec3::new(0.0, 0.0, 0.0), is_safe: false };
}

/// How well a voxel is enclosed by the surface.
struct Enclosure {
    /// Directions of the 26 in which no surface is met.
    escapes: usize,
    /// Shortest distance to the surface in the other directions, metres.
    depth: f64,
}

/// The voxel in which the mesh starts.
struct Seed {
    voxel: Voxel,
    /// Distance from its centre to the surface, metres.
    depth: f64,
}

/// The inflated mesh of `cloud`, in voxels of edge `edge` (metres).
///
/// # Errors
/// [`Error::Input`] if no voxel is enclosed by the points; [`Error::Cancelled`].
pub(super) fn inflate(cloud: &Cloud, edge: f64, progress: &Progress) -> Result<Mesh> {
    let bounds = Aabb::from_points(&cloud.points);
    let mut spaces = Spaces::new(cloud, &bounds, edge);
    let seed = spaces.find_seed(&bounds).ok_or_else(|| {
        Error::input(
            "no voxel is enclosed by the points: scan more sides, or use reconstruct.inflate = field, which \
             closes holes",
        )
    })?;
    spaces.inside.set(seed.voxel, true);
    let half = (SEED_HALF_SIDE * edge).min(MAX_SEED_HALF_SIDE_DEPTHS * seed.depth);
    let mut mesh = HalfEdgeMesh::new(&tetrahedron(&voxel_center(seed.voxel, edge), half))?;
    let max_steps = (MAX_STEPS_PER_VOXEL * bounds.diagonal() / edge) as usize;
    let mut volumes = Vec::new();
    for step in 0..max_steps {
        progress.report("inflate", step as f64 / (step as f64 + HALF_PROGRESS_STEPS))?;
        let snapshot = mesh.to_mesh();
        spaces.fill(&snapshot);
        volumes.push(snapshot.volume());
        // Departure: relaxing and pushing balance where the mesh cannot grow, and the last vertex
        // may never stop.
        if has_stopped_growing(&volumes) {
            break;
        }
        let (targets, moved) = spaces.targets(&mesh, snapshot)?;
        if moved == 0 {
            break;
        }
        move_guarded(&mut mesh, &targets);
        // Departure: besides the thesis's splits, short edges collapse and obtuse ones flip. Splits
        // alone pile up slivers, whose beams meet their own neighbours and whose moves would make
        // the mesh intersect itself: it can get stuck half-way.
        edit_guarded(&mut mesh, |mesh, frozen| remesh(mesh, EDGE_PER_VOXEL * edge, frozen));
    }
    Ok(mesh.into_mesh())
}

/// Whether the last of `volumes` is hardly larger than that of [`GROWTH_STEPS`] steps before.
fn has_stopped_growing(volumes: &[f64]) -> bool {
    let mut recent = volumes.iter().rev();
    let (last, before) = (recent.next(), recent.nth(GROWTH_STEPS - 1));
    last.zip(before).is_some_and(|(last, before)| {
        // Not `<=`: a volume that is not a number has not grown.
        let has_grown = *last > (1.0 + MIN_GROWTH) * before;
        !has_grown
    })
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

    /// The voxel that the surface encloses in the most of the 26 directions, among these the one
    /// farthest from it. The thesis leaves the place of the seed to the user.
    fn find_seed(&self, bounds: &Aabb) -> Option<Seed> {
        let (low, high) = (self.surface.voxel_of(&bounds.min), self.surface.voxel_of(&bounds.max));
        let longest = (high[0] - low[0]).max(high[1] - low[1]).max(high[2] - low[2]);
        let stride = (longest / SEED_CANDIDATES).max(1) as usize;
        let mut candidates: Vec<Voxel> = Vec::new();
        for x in (low[0]..=high[0]).step_by(stride) {
            for y in (low[1]..=high[1]).step_by(stride) {
                candidates.extend((low[2]..=high[2]).step_by(stride).map(|z| [x, y, z]));
            }
        }
        let found: Vec<Enclosure> = candidates.par_iter().map(|v| self.enclosure(*v)).collect();
        let best = (0..candidates.len())
            .filter(|&i| found[i].escapes <= MAX_ESCAPES && found[i].depth > 0.0)
            .min_by(|&a, &b| {
                let (one, two) = (&found[a], &found[b]);
                let by_depth = two.depth.total_cmp(&one.depth);
                one.escapes.cmp(&two.escapes).then(by_depth).then(a.cmp(&b))
            })?;
        Some(Seed { voxel: candidates[best], depth: found[best].depth })
    }

    /// How the surface encloses `voxel`, by beams in the 26 directions to its neighbours.
    fn enclosure(&self, voxel: Voxel) -> Enclosure {
        let center = voxel_center(voxel, self.edge);
        let mut enclosure = Enclosure { escapes: 0, depth: f64::INFINITY };
        // Of the 27 offsets the middle one is the voxel itself.
        for offset in (0..27).filter(|i| *i != 13).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1]) {
            let direction = Vec3::from(offset.map(f64::from)).normalize();
            match self.distance_to_surface(&center, &direction) {
                Some(distance) => enclosure.depth = enclosure.depth.min(distance),
                None => enclosure.escapes += 1,
            }
        }
        enclosure
    }

    /// Distance from `from` along the unit vector `direction` to the first voxel of the surface,
    /// metres.
    fn distance_to_surface(&self, from: &Vec3, direction: &Vec3) -> Option<f64> {
        self.surface
            .find_first_on_ray(from, direction, self.reach, |occupied| occupied)
            .map(|(_, d)| d)
    }

    /// Marks the voxels that triangles of `mesh` touch, by points half a voxel apart.
    fn fill(&mut self, mesh: &Mesh) {
        for t in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(t);
            let longest = (b - a).norm().max((c - a).norm()).max((c - b).norm());
            let n = (longest / (FILL_SPACING_VOXELS * self.edge)).ceil().max(1.0) as usize;
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

    /// Where each vertex goes (metres), and how many of them move safely.
    fn targets(&self, mesh: &HalfEdgeMesh, snapshot: Mesh) -> Result<(Vec<Vec3>, usize)> {
        let front = Front {
            own: Surface::new(&snapshot.vertices, &snapshot.triangles)?,
            snapshot,
            normals: vertex_normals(mesh),
            offsets: mean_neighbour_offsets(mesh),
        };
        let moves: Vec<Move> = (0..mesh.positions.len())
            .into_par_iter()
            .map(|v| if mesh.is_vertex_alive(v as u32) { self.step(&front, v) } else { Move::NONE })
            .collect();
        let safe = moves.iter().filter(|m| m.is_safe).count();
        let targets = mesh.positions.iter().zip(moves).map(|(p, m)| p + m.displacement).collect();
        Ok((targets, safe))
    }

    /// The move of vertex `v`.
    fn step(&self, front: &Front, v: usize) -> Move {
        let (vertex, normal) = (front.snapshot.vertices[v], front.normals[v]);
        let direction = self.direction(&vertex);
        let mut way = direction.unwrap_or(normal);
        let mut beam = self.beam(front, &vertex, &normal, &way);
        if matches!(beam, Beam::Inwards) {
            // Departure: in a fold or a narrow place the inside voxels lie all round and give no
            // direction; the normal does.
            way = normal;
            beam = self.beam(front, &vertex, &normal, &way);
        }
        // Departure: along the surface the vertices spread evenly, which keeps triangles well
        // shaped.
        let offset = front.offsets[v];
        let tangential = (offset - normal * offset.dot(&normal)) * RELAXATION_RATIO;
        match beam {
            Beam::Safe(free) => Move { displacement: way * free + tangential, is_safe: true },
            Beam::Arrived => Move { displacement: tangential, is_safe: false },
            // Departure: a vertex that cannot move by itself follows its neighbours like a
            // membrane, so that holes in the points do not stop vertices one at a time and leave
            // dents. It never crosses the surface.
            Beam::Inwards | Beam::Escapes => {
                let follow = offset * RELAXATION_RATIO;
                let length = follow.norm();
                let crosses = length > 0.0
                    && self
                        .distance_to_surface(&vertex, &(follow / length))
                        .is_some_and(|d| d < length + ARRIVAL_VOXELS * self.edge);
                if crosses { Move::NONE } else { Move { displacement: follow, is_safe: false } }
            }
        }
    }

    /// What the beam from `vertex` along the unit vector `way` meets. The safe move is
    ///
    /// ```text
    /// k min(d_s, l)                                                                            (1)
    /// ```
    ///
    /// with the free distance `d_s` and the voxel edge `l`.
    fn beam(&self, front: &Front, vertex: &Vec3, normal: &Vec3, way: &Vec3) -> Beam {
        if way.dot(normal) <= 0.0 {
            return Beam::Inwards;
        }
        let Some(mut free) = self.distance_to_surface(vertex, way) else { return Beam::Escapes };
        // Departure: the beam starts a little above the vertex.
        let start = vertex + normal * (BEAM_START_VOXELS * self.edge);
        if let Some((distance, triangle)) = front.own.cast_ray(&start, way, free) {
            // Departure: only a triangle met from behind means that the beam points inwards. One
            // met from outside is another front of the mesh, and the way to it is free; the two
            // fronts share it and keep a voxel between them.
            if front.snapshot.triangle_normal(triangle).dot(way) >= 0.0 {
                return Beam::Inwards;
            }
            free = free.min(0.5 * (distance - self.edge));
        }
        if free <= ARRIVAL_VOXELS * self.edge {
            return Beam::Arrived;
        }
        Beam::Safe(STEP_RATIO * free.min(self.edge)) // (1)
    }

    /// Normalised sum of the vectors from the centres of the inside voxels near `vertex` to it;
    /// `None` if they cancel.
    fn direction(&self, vertex: &Vec3) -> Option<Vec3> {
        let center = self.inside.voxel_of(vertex);
        let mut sum = Vec3::zeros();
        for x in -DIRECTION_REACH_VOXELS..=DIRECTION_REACH_VOXELS {
            for y in -DIRECTION_REACH_VOXELS..=DIRECTION_REACH_VOXELS {
                for z in -DIRECTION_REACH_VOXELS..=DIRECTION_REACH_VOXELS {
                    let voxel = [center[0] + x, center[1] + y, center[2] + z];
                    if self.inside.get(voxel) {
                        sum += vertex - voxel_center(voxel, self.edge);
                    }
                }
            }
        }
        sum.try_normalize(MIN_DIRECTION_VOXELS * self.edge)
    }
}

#[cfg(test)]
#[path = "balloon_tests.rs"]
mod tests;
