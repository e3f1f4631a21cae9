use super::*;
use crate::mesh::{genus, is_closed, is_oriented, is_two_manifold, test_shapes};

fn assert_sound(mesh: &HalfEdgeMesh, expected_genus: i64) {
    for h in (0..mesh.half_edge_count()).filter(|h| mesh.is_alive(*h)) {
        assert_eq!(mesh.twin(mesh.twin(h)), h);
        assert_eq!(
            (mesh.from_vertex(h), mesh.to_vertex(h)),
            (mesh.to_vertex(mesh.twin(h)), mesh.from_vertex(mesh.twin(h)))
        );
        assert!(mesh.outgoing_half_edges(mesh.from_vertex(h)).any(|spoke| spoke == h));
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
        for h in (0..mesh.half_edge_count()).step_by(7) {
            let middle = (mesh.positions[mesh.from_vertex(h) as usize]
                + mesh.positions[mesh.to_vertex(h) as usize])
                / 2.0;
            mesh.split_edge(h, middle);
        }
        assert_sound(&mesh, expected_genus);
        for h in (0..mesh.half_edge_count()).step_by(5).filter(|h| *h != NO_INDEX) {
            if mesh.can_flip(h) {
                mesh.flip_edge(h);
            }
        }
        assert_sound(&mesh, expected_genus);
        let mut collapsed = 0;
        for h in (0..mesh.half_edge_count()).step_by(3) {
            if mesh.is_alive(h) && mesh.can_collapse(h) {
                let position = mesh.positions[mesh.to_vertex(h) as usize];
                mesh.collapse_edge(h, position);
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
    for h in (0..mesh.half_edge_count()).step_by(7) {
        if mesh.is_alive(h) && mesh.can_collapse(h) {
            mesh.collapse_edge(h, mesh.positions[mesh.from_vertex(h) as usize]);
        }
    }
    let compacted = mesh.clone().compacted();
    assert!(compacted.positions.len() < mesh.positions.len());
    assert!(compacted.half_edge_count() < mesh.half_edge_count());
    assert_sound(&compacted, 1);
    assert_eq!(compacted.into_mesh(), mesh.into_mesh());
}

#[test]
fn everything_collapses_at_most_to_a_tetrahedron() {
    let mut mesh = HalfEdgeMesh::new(&test_shapes::sphere(1.0, 2)).unwrap();
    for _ in 0..50 {
        for h in 0..mesh.half_edge_count() {
            if mesh.is_alive(h) && mesh.can_collapse(h) {
                let position = mesh.positions[mesh.to_vertex(h) as usize];
                mesh.collapse_edge(h, position);
            }
        }
    }
    assert_sound(&mesh, 0);
    assert_eq!(mesh.into_mesh().triangles.len(), 4);
}

#[test]
fn the_one_ring_of_a_box_corner_is_that_of_the_triangles() {
    let shape = test_shapes::cuboid(Vec3::zeros(), Vec3::repeat(1.0));
    let mesh = HalfEdgeMesh::new(&shape).unwrap();
    for v in 0..8 {
        let mut found: Vec<u32> = mesh.one_ring(v).collect();
        found.sort_unstable();
        let around = shape.triangles.iter().filter(|t| t.contains(&v));
        let mut expected: Vec<u32> = around.flatten().copied().filter(|w| *w != v).collect();
        expected.sort_unstable();
        expected.dedup();
        assert_eq!(found, expected);
        assert_eq!(mesh.valence(v), expected.len());
    }
    assert_eq!(mesh.into_mesh(), shape);
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
