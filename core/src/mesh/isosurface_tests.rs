use super::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Asserts that the mesh is closed, oriented and two-manifold at every vertex; returns its Euler
/// number and its number of components.
pub(crate) fn assert_manifold(mesh: &Mesh) -> (i64, usize) {
    let mut fans: Vec<Vec<(u32, u32)>> = vec![Vec::new(); mesh.vertices.len()];
    for t in &mesh.triangles {
        assert!(t[0] != t[1] && t[1] != t[2] && t[2] != t[0], "degenerate {t:?}");
        for i in 0..3 {
            fans[t[i] as usize].push((t[(i + 1) % 3], t[(i + 2) % 3]));
        }
    }
    let mut parent: Vec<usize> = (0..mesh.vertices.len()).collect();
    for (v, fan) in fans.iter().enumerate() {
        assert!(fan.len() >= 3, "vertex {v} has {} triangles", fan.len());
        // Each neighbour begins one triangle and ends one, and following them visits the whole fan.
        let (mut at, mut steps) = (fan[0].0, 0);
        loop {
            let next: Vec<u32> = fan.iter().filter(|e| e.0 == at).map(|e| e.1).collect();
            assert_eq!(next.len(), 1, "edge {v} {at} has {} triangles to its left", next.len());
            (at, steps) = (next[0], steps + 1);
            if at == fan[0].0 {
                break;
            }
            assert!(steps <= fan.len(), "the fan of vertex {v} is no cycle");
        }
        assert_eq!(steps, fan.len(), "vertex {v} has more than one fan");
        for &(a, _) in fan {
            let (to, from) = (root(&mut parent, v), root(&mut parent, a as usize));
            parent[from] = to;
        }
    }
    let components = (0..fans.len()).filter(|&v| root(&mut parent, v) == v).count();
    let edges = 3 * mesh.triangles.len() / 2;
    (mesh.vertices.len() as i64 - edges as i64 + mesh.triangles.len() as i64, components)
}

/// The root of a set in a union-find forest.
fn root(parent: &mut [usize], mut v: usize) -> usize {
    while parent[v] != v {
        parent[v] = parent[parent[v]];
        v = parent[v];
    }
    v
}

fn cube(half: f64) -> Aabb {
    Aabb { min: Vec3::repeat(-half), max: Vec3::repeat(half) }
}

#[test]
fn a_sphere_has_its_volume_and_euler_number() {
    let mesh = Lattice::sample(&cube(1.2), 0.05, |p| p.norm() - 1.0).extract_isosurface();
    assert_eq!(assert_manifold(&mesh), (2, 1));
    let exact = 4.0 / 3.0 * std::f64::consts::PI;
    assert!((mesh.volume() / exact - 1.0).abs() < 3e-3, "{}", mesh.volume() / exact);
    for vertex in &mesh.vertices {
        assert!((vertex.norm() - 1.0).abs() < 5e-3);
    }
}

#[test]
fn a_torus_has_its_volume_and_euler_number() {
    let mesh = Lattice::sample(&cube(1.5), 0.04, |p| (p.xy().norm() - 1.0).hypot(p.z) - 0.4)
        .extract_isosurface();
    assert_eq!(assert_manifold(&mesh), (0, 1));
    let exact = 2.0 * std::f64::consts::PI.powi(2) * 0.4 * 0.4;
    assert!((mesh.volume() / exact - 1.0).abs() < 5e-3, "{}", mesh.volume() / exact);
}

#[test]
fn what_touches_the_border_is_closed_there() {
    let lattice =
        Lattice { spacing: 1.0, size: [3, 4, 5], values: vec![-1.0; 60], ..Lattice::default() };
    let mesh = lattice.extract_isosurface();
    assert_eq!(assert_manifold(&mesh), (2, 1));
    assert!(
        mesh.volume() > 2.0 * 3.0 * 4.0 && mesh.volume() < 3.0 * 4.0 * 5.0,
        "{}",
        mesh.volume()
    );
}

#[test]
fn nothing_inside_gives_nothing() {
    assert!(Lattice::sample(&cube(1.0), 0.5, |_| 0.0).extract_isosurface().vertices.is_empty());
    assert!(Lattice::default().extract_isosurface().triangles.is_empty());
}

fn noise(n: usize, seed: u64) -> Mesh {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // Zeros, NaN and infinities are as good as any other value.
    let odd = [0.0, -0.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e-30, -1e-30];
    let values = (0..n * n * n).map(|_| {
        let v: f32 = rng.random_range(-1.0..1.0);
        if rng.random_bool(0.05) { odd[rng.random_range(0..odd.len())] } else { v }
    });
    let values = values.collect();
    Lattice { origin: Vec3::zeros(), spacing: 1.0, size: [n; 3], values }.extract_isosurface()
}

#[test]
fn noise_gives_a_closed_manifold() {
    for seed in 0..3 {
        let mesh = noise(20, seed);
        assert!(mesh.triangles.len() > 10_000);
        assert!(mesh.vertices.iter().all(|v| v.iter().all(|c| c.is_finite())));
        assert_manifold(&mesh);
        assert!(mesh.volume() > 0.0);
        for i in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(i);
            assert!((b - a).cross(&(c - a)).norm() > 1e-3, "triangle {i} is degenerate");
        }
    }
}

/// Six times the signed volume of a tetrahedron.
fn volume([a, b, c, d]: [&Vec3; 4]) -> f64 {
    (b - a).cross(&(c - a)).dot(&(d - a))
}

/// Whether the segment from `p` to `q` goes through the triangle.
pub(crate) fn pierces(p: &Vec3, q: &Vec3, [a, b, c]: &[Vec3; 3]) -> bool {
    let sides = [volume([p, q, a, b]), volume([p, q, b, c]), volume([p, q, c, a])];
    let across = volume([a, b, c, p]) * volume([a, b, c, q]) < -1e-14;
    across && (sides.iter().all(|&s| s > 1e-9) || sides.iter().all(|&s| s < -1e-9))
}

#[test]
fn noise_gives_no_self_intersection() {
    let mesh = noise(9, 5);
    let corners: Vec<_> = (0..mesh.triangles.len()).map(|i| mesh.corners(i)).collect();
    let boxes: Vec<Aabb> = corners.iter().map(Aabb::from_points).collect();
    for i in 0..corners.len() {
        for j in (0..corners.len()).filter(|&j| j != i && boxes[i].intersects(&boxes[j])) {
            for k in 0..3 {
                let (p, q) = (&corners[i][k], &corners[i][(k + 1) % 3]);
                assert!(!pierces(p, q, &corners[j]), "triangles {i} and {j} intersect");
            }
        }
    }
}

#[test]
fn the_surface_does_not_depend_on_the_number_of_threads() {
    let [single, double] = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            Lattice::sample(&cube(1.2), 0.1, |p| p.norm() - 1.0 + p.x.sin()).extract_isosurface()
        })
    });
    assert_eq!(single, double);
}

#[test]
#[ignore = "a measurement, not a check: prints the time for 27 million corners"]
fn time_of_27_million_corners() {
    let lattice = Lattice::sample(&cube(1.2), 2.4 / 299.0, |p| p.norm() - 1.0);
    let start = std::time::Instant::now();
    let mesh = lattice.extract_isosurface();
    eprintln!("{} triangles in {:?}", mesh.triangles.len(), start.elapsed());
}
