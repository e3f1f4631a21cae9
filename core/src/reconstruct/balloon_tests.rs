use super::*;

const EDGE: f64 = 0.1;

/// The spaces of a cube of side 2 about the origin whose walls are points 0.05 apart, without
/// those above `top`.
fn cube_spaces(top: f64) -> (Spaces, Aabb) {
    let mut cloud = Cloud::default();
    for i in 0..41 {
        for j in 0..41 {
            let (u, v) = (f64::from(i) * 0.05 - 1.0, f64::from(j) * 0.05 - 1.0);
            for side in [-1.0, 1.0] {
                for p in [Vec3::new(side, u, v), Vec3::new(u, side, v), Vec3::new(u, v, side)] {
                    if p.z < top {
                        cloud.push(p, Vec3::z(), 1e-3, 1);
                    }
                }
            }
        }
    }
    let bounds = Aabb { min: Vec3::repeat(-1.0), max: Vec3::repeat(1.0) };
    (Spaces::new(&cloud, &bounds, EDGE), bounds)
}

#[test]
fn the_seed_is_the_deepest_voxel_of_a_cube() {
    let (spaces, bounds) = cube_spaces(2.0);
    let seed = spaces.find_seed(&bounds).unwrap();
    assert!(voxel_center(seed.voxel, EDGE).amax() < 0.15, "{:?}", seed.voxel);
    assert!((seed.depth - 1.0).abs() < 0.15, "{}", seed.depth);
    assert_eq!(spaces.enclosure(seed.voxel).escapes, 0);
}

#[test]
fn an_open_side_lets_nine_directions_escape() {
    let (spaces, bounds) = cube_spaces(0.95);
    let seed = spaces.find_seed(&bounds).unwrap();
    let enclosure = spaces.enclosure(seed.voxel);
    assert!((1..=MAX_ESCAPES).contains(&enclosure.escapes), "{}", enclosure.escapes);
}

#[test]
fn a_vertex_moves_by_its_share_of_a_voxel_and_stops_at_the_surface() {
    let (spaces, _) = cube_spaces(2.0);
    let mesh = HalfEdgeMesh::new(&tetrahedron(&Vec3::zeros(), 0.2)).unwrap();
    let snapshot = mesh.to_mesh();
    let front = Front {
        own: Surface::new(&snapshot.vertices, &snapshot.triangles).unwrap(),
        normals: vertex_normals(&mesh),
        offsets: mean_neighbour_offsets(&mesh),
        snapshot,
    };
    let x = Vec3::x();
    let beam = spaces.beam(&front, &(x * 0.3), &x, &x);
    assert!(matches!(beam, Beam::Safe(free) if (free - STEP_RATIO * EDGE).abs() < 1e-12));
    assert!(matches!(spaces.beam(&front, &(x * 0.97), &x, &x), Beam::Arrived));
    assert!(matches!(spaces.beam(&front, &(x * 0.3), &x, &-x), Beam::Inwards));
    assert!(matches!(spaces.beam(&front, &(x * 1.5), &x, &x), Beam::Escapes));
}

#[test]
fn growth_is_measured_over_six_steps() {
    let mut volumes: Vec<f64> = (0..6).map(f64::from).collect();
    assert!(!has_stopped_growing(&volumes));
    volumes.extend([5.0; 6]);
    assert!(!has_stopped_growing(&volumes[..11]), "from 4 to 5");
    assert!(has_stopped_growing(&volumes), "from 5 to 5");
}
