//! Forces that keep the mesh smooth and its triangles well shaped.

use crate::geometry::Vec3;
use crate::mesh::HalfEdgeMesh;

/// Parameters of [`smooth`] (Wiedemann 2014, §2.4.4).
pub(super) struct Smoothing {
    /// `k_s`, below 0.5.
    pub strength: f64,
    /// Angles between vertex normals outside `[min, max]` (radians) are left alone.
    pub angles: [f64; 2],
}

/// Displacements that bring opposite vertices of neighbouring triangles to each other's tangent planes
/// (Wiedemann 2014, §2.4.4). `confidence` in 0..=1: of two vertices the less certain one moves more.
pub(super) fn smooth(
    mesh: &HalfEdgeMesh,
    normals: &[Vec3],
    confidence: &[f64],
    smoothing: &Smoothing,
) -> Vec<Vec3> {
    let mut sums = vec![(Vec3::zeros(), 0.0); mesh.positions.len()];
    for h in (0..mesh.half_edges()).filter(|h| mesh.is_alive(*h)) {
        let (i, j) = (mesh.apex(h) as usize, mesh.apex(mesh.twin(h)) as usize);
        let angle = normals[i].angle(&normals[j]);
        if !(smoothing.angles[0]..=smoothing.angles[1]).contains(&angle) {
            continue;
        }
        let distance = normals[i].dot(&(mesh.positions[j] - mesh.positions[i]));
        let u = smoothing.strength * distance;
        let share = 0.5 * (1.0 + confidence[j] - confidence[i]);
        add(&mut sums[i], normals[i] * (u * share));
        add(&mut sums[j], normals[i] * (-u * (1.0 - share)));
    }
    sums.into_iter().map(mean).collect()
}

/// Displacements that bring the angles of the triangles to 60 degrees (Wiedemann 2014, §2.4.5, the double product
/// normalised and scaled by the edge).
pub(super) fn regularise(mesh: &HalfEdgeMesh, strength: f64) -> Vec<Vec3> {
    let mut sums = vec![(Vec3::zeros(), 0.0); mesh.positions.len()];
    for h in (0..mesh.half_edges()).filter(|h| mesh.is_alive(*h)) {
        let (shared, near, far) =
            (mesh.from(h) as usize, mesh.to(h) as usize, mesh.apex(h) as usize);
        // Each edge of the angle is turned in its turn.
        for (one, two) in [(near, far), (far, near)] {
            let (e1, e2) = (
                mesh.positions[one] - mesh.positions[shared],
                mesh.positions[two] - mesh.positions[shared],
            );
            let Some(turn) = e2.cross(&e2.cross(&e1)).try_normalize(0.0) else { continue };
            let a = e1.dot(&e2) / (e1.norm() * e2.norm()) - 0.5;
            let u = turn * (strength * a * e2.norm());
            add(&mut sums[two], u);
            add(&mut sums[shared], -u);
        }
    }
    sums.into_iter().map(mean).collect()
}

/// The displacement of each vertex to the mean of its neighbours.
pub(super) fn umbrella(mesh: &HalfEdgeMesh) -> Vec<Vec3> {
    let displacement = |v: u32| {
        let (sum, count) = mesh.neighbours(v).fold((Vec3::zeros(), 0.0), |(sum, count), w| {
            (sum + mesh.positions[w as usize], count + 1.0)
        });
        if count > 0.0 { sum / count - mesh.positions[v as usize] } else { Vec3::zeros() }
    };
    (0..mesh.positions.len() as u32).map(displacement).collect()
}

fn add(sum: &mut (Vec3, f64), displacement: Vec3) {
    sum.0 += displacement;
    sum.1 += 1.0;
}

fn mean((sum, count): (Vec3, f64)) -> Vec3 {
    if count > 0.0 { sum / count } else { sum }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::remesh::vertex_normals;
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
        let mean = |mesh: &HalfEdgeMesh| {
            let angles = min_angles(&mesh.snapshot());
            angles.iter().sum::<f64>() / angles.len() as f64
        };
        let before = mean(&mesh);
        for _ in 0..20 {
            let moves = regularise(&mesh, 0.2);
            mesh.positions.iter_mut().zip(moves).for_each(|(p, m)| *p += m);
        }
        assert!(mean(&mesh) > before * 1.03, "{} {before}", mean(&mesh));
    }
}
