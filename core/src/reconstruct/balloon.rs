//! The thesis's inflation (Wiedemann 2014, §2.4.2): a tetrahedron in one voxel of the inside space grows until no
//! vertex can move safely. What is ours: where the seed stands, and that a move which would make the mesh cut
//! itself is taken back.

use super::guard::{edit_guarded, move_guarded};
use crate::geometry::{Aabb, Cloud, Surface, Vec3};
use crate::mesh::remesh::{split_long, vertex_normals};
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

struct Spaces {
    edge: f64,
    /// Voxels that hold a point.
    surface: VoxelSpace<bool>,
    /// Voxels that the mesh passed or passes.
    inside: VoxelSpace<bool>,
    reach: f64,
}

/// The inflated mesh in voxels of edge `edge` (metres).
///
/// # Errors
/// [`Error::Input`] if no voxel is enclosed by the points; [`Error::Cancelled`].
pub(super) fn inflate(cloud: &Cloud, edge: f64, progress: &Progress) -> Result<Mesh> {
    let bounds = Aabb::of(&cloud.points);
    let mut surface = VoxelSpace::new(edge);
    for point in &cloud.points {
        let voxel = surface.voxel_of(point);
        surface.set(voxel, true);
    }
    let mut spaces =
        Spaces { edge, surface, inside: VoxelSpace::new(edge), reach: bounds.diagonal() + edge };
    let seed = spaces.seed(&bounds).ok_or_else(|| {
        Error::input(
            "no voxel is enclosed by the points: scan more sides, or use reconstruct.inflate = field, which \
             closes holes",
        )
    })?;
    spaces.inside.set(seed, true);
    let mut mesh = HalfEdgeMesh::new(&tetrahedron(&voxel_center(seed, edge), edge))?;
    let most = (SLACK * bounds.diagonal() / edge) as usize;
    for step in 0..most {
        progress.report("inflate", step as f64 / (step as f64 + 100.0))?;
        spaces.fill(&mesh.snapshot());
        let (targets, moved) = spaces.targets(&mesh)?;
        let held = if moved > 0 { move_guarded(&mut mesh, &targets) } else { 0 };
        if moved == 0 || held >= moved {
            break;
        }
        edit_guarded(&mut mesh, |mesh, _| split_long(mesh, 2.0 * edge));
    }
    Ok(mesh.into_mesh())
}

/// A regular tetrahedron round `center` that pokes a little out of its voxel on all sides.
fn tetrahedron(center: &Vec3, edge: f64) -> Mesh {
    let corners = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    let vertices = corners.map(|c| center + Vec3::from(c) * (0.5 * edge)).to_vec();
    Mesh::new(vertices, vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
}

impl Spaces {
    /// The voxel, enclosed by surface in all 26 directions, that is farthest from it.
    fn seed(&self, bounds: &Aabb) -> Option<Voxel> {
        let (low, high) = (self.surface.voxel_of(&bounds.min), self.surface.voxel_of(&bounds.max));
        // A coarser grid finds the deepest place as well, and tries a thousandth of the voxels.
        let stride = ((high[0] - low[0]).max(high[1] - low[1]).max(high[2] - low[2]) / 40).max(1);
        let along = |i: usize| (low[i]..=high[i]).step_by(stride as usize);
        let candidates: Vec<Voxel> = along(0)
            .flat_map(|x| along(1).flat_map(move |y| along(2).map(move |z| [x, y, z])))
            .collect();
        let depths: Vec<f64> = candidates.par_iter().map(|v| self.depth(*v)).collect();
        let best = (0..candidates.len())
            .max_by(|&a, &b| depths[a].total_cmp(&depths[b]).then(b.cmp(&a)))?;
        (depths[best] > 0.0).then(|| candidates[best])
    }

    /// Shortest distance to the surface over the 26 directions; 0 if one of them escapes.
    fn depth(&self, voxel: Voxel) -> f64 {
        let center = voxel_center(voxel, self.edge);
        let directions =
            (0..27).filter(|i| *i != 13).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1]);
        directions
            .map(|d| Vec3::from_fn(|i, _| f64::from(d[i])).normalize())
            .map(|d| self.to_surface(&center, &d).unwrap_or(0.0))
            .fold(f64::INFINITY, f64::min)
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

    /// Where each vertex goes, and how many of them move.
    fn targets(&self, mesh: &HalfEdgeMesh) -> Result<(Vec<Vec3>, usize)> {
        let snapshot = mesh.snapshot();
        let own = Surface::new(&snapshot.vertices, &snapshot.triangles)?;
        let normals = vertex_normals(mesh);
        let moves: Vec<Option<Vec3>> = (0..mesh.positions.len())
            .into_par_iter()
            .map(|v| self.safe_move(&own, &mesh.positions[v], &normals[v]))
            .collect();
        let moved = moves.iter().flatten().count();
        let targets =
            mesh.positions.iter().zip(moves).map(|(p, m)| m.map_or(*p, |m| p + m)).collect();
        Ok((targets, moved))
    }

    /// `k min(d_s, l)` along the direction away from the inside voxels; `None` if the beam meets the mesh (it points
    /// inwards) or no surface voxel (it would escape), or the vertex has arrived within half a voxel.
    fn safe_move(&self, own: &Surface, vertex: &Vec3, normal: &Vec3) -> Option<Vec3> {
        let direction = self.direction(vertex)?;
        let free = self.to_surface(vertex, &direction)?;
        // Start clear of the vertex's own triangles.
        let start = vertex + direction * (1e-3 * self.edge);
        let inwards = own.cast_ray(&start, &direction, free).is_some();
        if inwards || direction.dot(normal) <= 0.0 || free <= 0.5 * self.edge {
            return None;
        }
        Some(direction * (STEP * free.min(self.edge)))
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
