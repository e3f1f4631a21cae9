//! Forces that keep the mesh smooth and its triangles well shaped.

use crate::geometry::Vec3;
use crate::mesh::HalfEdgeMesh;

/// Cosine of the angle of a regular triangle.
const COS_60: f64 = 0.5;

/// Parameters of [`smooth`] (Wiedemann 2014, §2.4.3).
pub(super) struct Smoothing {
    /// Strength `k_s`, below 0.5.
    pub strength: f64,
    /// Smallest and largest angle between vertex normals (radians) at which vertices are moved.
    pub angles: [f64; 2],
}

/// Displacements of the vertices, metres, that bring the opposite vertices of neighbouring
/// triangles to each other's tangent planes (Wiedemann 2014, §2.4.3):
///
/// ```text
/// u = k_s n_i . (v_j - v_i)                                                                    (1)
/// share = (1 + conf(j) - conf(i)) / 2                                                          (2)
/// ```
///
/// Vertex i moves by `share u` along `n_i` and vertex j by the rest the other way. `confidence` is
/// within 0..=1: of two vertices the less certain one moves more.
pub(super) fn smooth(
    mesh: &HalfEdgeMesh,
    normals: &[Vec3],
    confidence: &[f64],
    smoothing: &Smoothing,
) -> Vec<Vec3> {
    let mut sums = vec![MeanDisplacement::NONE; mesh.positions.len()];
    for h in (0..mesh.half_edge_count()).filter(|h| mesh.is_alive(*h)) {
        let (i, j) =
            (mesh.opposite_vertex(h) as usize, mesh.opposite_vertex(mesh.twin(h)) as usize);
        let angle = normals[i].angle(&normals[j]);
        if !(smoothing.angles[0]..=smoothing.angles[1]).contains(&angle) {
            continue;
        }
        let distance = normals[i].dot(&(mesh.positions[j] - mesh.positions[i]));
        let u = smoothing.strength * distance; // (1)
        let share = 0.5 * (1.0 + confidence[j] - confidence[i]); // (2)
        sums[i].add(normals[i] * (u * share));
        sums[j].add(normals[i] * (-u * (1.0 - share)));
    }
    sums.into_iter().map(MeanDisplacement::mean).collect()
}

/// Displacements of the vertices, metres, that bring the angles of the triangles to 60 degrees
/// (Wiedemann 2014, §2.4.3; the double product is normalised and scaled by the edge):
///
/// ```text
/// u = k_reg (cos(e1, e2) - cos 60) |e2| (e2 x (e2 x e1)) / |e2 x (e2 x e1)|                    (3)
/// ```
pub(super) fn regularise(mesh: &HalfEdgeMesh, strength: f64) -> Vec<Vec3> {
    let mut sums = vec![MeanDisplacement::NONE; mesh.positions.len()];
    for h in (0..mesh.half_edge_count()).filter(|h| mesh.is_alive(*h)) {
        let (shared, near, far) = (
            mesh.from_vertex(h) as usize,
            mesh.to_vertex(h) as usize,
            mesh.opposite_vertex(h) as usize,
        );
        // Both edges of the angle turn, one after the other.
        for (one, two) in [(near, far), (far, near)] {
            let (e1, e2) = (
                mesh.positions[one] - mesh.positions[shared],
                mesh.positions[two] - mesh.positions[shared],
            );
            let Some(turn) = e2.cross(&e2.cross(&e1)).try_normalize(0.0) else { continue };
            let excess = e1.dot(&e2) / (e1.norm() * e2.norm()) - COS_60;
            let u = turn * (strength * excess * e2.norm()); // (3)
            sums[two].add(u);
            sums[shared].add(-u);
        }
    }
    sums.into_iter().map(MeanDisplacement::mean).collect()
}

/// The displacement of each vertex to the mean of its neighbours, metres (umbrella operator; Taubin
/// 1995).
pub(super) fn mean_neighbour_offsets(mesh: &HalfEdgeMesh) -> Vec<Vec3> {
    (0..mesh.positions.len() as u32).map(|v| mean_neighbour_offset(mesh, v)).collect()
}

/// The displacement of vertex `v` to the mean of its neighbours, metres; zero if it has none.
fn mean_neighbour_offset(mesh: &HalfEdgeMesh, v: u32) -> Vec3 {
    let (sum, count) = mesh.one_ring(v).fold((Vec3::zeros(), 0.0), |(sum, count), w| {
        (sum + mesh.positions[w as usize], count + 1.0)
    });
    if count > 0.0 { sum / count - mesh.positions[v as usize] } else { Vec3::zeros() }
}

/// The mean of displacements, as it is summed up.
#[derive(Clone, Copy)]
struct MeanDisplacement {
    sum: Vec3,
    count: f64,
}

impl MeanDisplacement {
    const NONE: MeanDisplacement = MeanDisplacement { sum: Vec3::new(0.0, 0.0, 0.0), count: 0.0 };

    fn add(&mut self, displacement: Vec3) {
        self.sum += displacement;
        self.count += 1.0;
    }

    fn mean(self) -> Vec3 {
        if self.count > 0.0 { self.sum / self.count } else { self.sum }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::remeshing::vertex_normals;
    use crate::mesh::{min_angles, test_shapes};

    fn bumpy() -> HalfEdgeMesh {
        let mut shape = test_shapes::sphere(1.0, 3);
        for (i, vertex) in shape.vertices.iter_mut().enumerate() {
            *vertex *= 1.0 + 0.02 * (i as f64 * 1.7).sin();
        }
        HalfEdgeMesh::new(&shape).unwrap()
    }

    fn roughness(mesh: &HalfEdgeMesh) -> f64 {
        let mean =
            mesh.positions.iter().map(|p| p.norm()).sum::<f64>() / mesh.positions.len() as f64;
        (mesh.positions.iter().map(|p| (p.norm() - mean).powi(2)).sum::<f64>()
            / mesh.positions.len() as f64)
            .sqrt()
    }

    fn mean_min_angle(mesh: &HalfEdgeMesh) -> f64 {
        let angles = min_angles(&mesh.to_mesh());
        angles.iter().sum::<f64>() / angles.len() as f64
    }

    #[test]
    fn a_vertex_of_an_octahedron_moves_to_the_middle_of_its_four_neighbours() {
        let octahedron = test_shapes::octahedron();
        let mesh = HalfEdgeMesh::new(&octahedron).unwrap();
        for (offset, corner) in mean_neighbour_offsets(&mesh).iter().zip(&octahedron.vertices) {
            assert!((offset + corner).norm() < 1e-15, "{offset}");
        }
        // All its triangles are regular: regularising moves nothing.
        assert!(regularise(&mesh, 0.5).iter().all(|moved| moved.norm() < 1e-12));
    }

    #[test]
    fn smoothing_flattens_bumps() {
        let mut mesh = bumpy();
        let before = roughness(&mesh);
        let confidence = vec![0.5; mesh.positions.len()];
        for _ in 0..20 {
            let normals = vertex_normals(&mesh);
            let moves = smooth(
                &mesh,
                &normals,
                &confidence,
                &Smoothing { strength: 0.4, angles: [0.0, 3.2] },
            );
            mesh.positions.iter_mut().zip(moves).for_each(|(p, m)| *p += m);
        }
        assert!(roughness(&mesh) < 0.4 * before, "{} {before}", roughness(&mesh));
    }

    #[test]
    fn the_certain_vertex_stays_and_the_uncertain_moves() {
        let mesh = bumpy();
        let mut confidence = vec![0.0; mesh.positions.len()];
        confidence[5] = 1.0;
        let smoothing = Smoothing { strength: 0.4, angles: [0.0, 3.2] };
        let moves = smooth(&mesh, &vertex_normals(&mesh), &confidence, &smoothing);
        assert!(moves[5].norm() < 1e-12);
        let alike = smooth(&mesh, &vertex_normals(&mesh), &vec![0.0; confidence.len()], &smoothing);
        assert!(alike[5].norm() > 1e-4);
    }

    #[test]
    fn regularising_widens_the_smallest_angles() {
        let mut mesh = HalfEdgeMesh::new(&test_shapes::torus(1.0, 0.4, 40, 9)).unwrap();
        let before = mean_min_angle(&mesh);
        for _ in 0..20 {
            let moves = regularise(&mesh, 0.2);
            mesh.positions.iter_mut().zip(moves).for_each(|(p, m)| *p += m);
        }
        let after = mean_min_angle(&mesh);
        assert!(after > before * 1.03, "{after} {before}");
    }
}
