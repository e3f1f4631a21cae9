use super::*;
use crate::geometry::Vec3;
use crate::mesh::{
    components, genus, is_closed, is_oriented, is_two_manifold, self_intersections, test_shapes,
};

/// Points on the triangles of `shape`, about `spacing` apart, with their normals.
fn cloud_on(shape: &Mesh, spacing: f64) -> Cloud {
    let mut shape = shape.clone();
    shape.compute_normals();
    let mut cloud = Cloud::default();
    for (t, triangle) in shape.triangles.iter().enumerate() {
        let [a, b, c] = shape.corners(t);
        let [na, nb, nc] = triangle.map(|v| shape.normals[v as usize]);
        let n = ((b - a).norm().max((c - a).norm()) / spacing).ceil() as usize;
        for i in 0..n {
            for j in 0..n - i {
                let (u, v) = ((i as f64 + 0.33) / n as f64, (j as f64 + 0.33) / n as f64);
                let w = 1.0 - u - v;
                cloud.push(a * w + b * u + c * v, (na * w + nb * u + nc * v).normalize(), 1e-4, 3);
            }
        }
    }
    cloud
}

fn assert_watertight(mesh: &Mesh, expected_genus: i64) {
    assert!(is_closed(mesh) && is_two_manifold(mesh) && is_oriented(mesh));
    assert!(self_intersections(mesh).is_empty());
    assert_eq!(components(mesh), 1);
    assert_eq!(genus(mesh), Some(expected_genus));
    assert!(mesh.volume() > 0.0);
}

fn run(cloud: &Cloud, params: &ReconstructParams) -> Mesh {
    reconstruct(cloud, params, &Progress::silent()).unwrap()
}

#[test]
fn a_sphere_comes_out_round_and_observed() {
    let cloud = cloud_on(&test_shapes::sphere(0.05, 4), 0.0015);
    let mesh = run(&cloud, &ReconstructParams::default());
    assert_watertight(&mesh, 0);
    let worst = mesh.vertices.iter().map(|v| (v.norm() - 0.05).abs()).fold(0.0, f64::max);
    assert!(worst < 1.5e-4, "{worst}");
    assert!(mesh.observed.iter().all(|o| *o));
    assert!(mesh.sigma.iter().all(|s| *s > 5e-5 && *s < 3e-4));
}

#[test]
fn a_torus_keeps_its_handle() {
    let cloud = cloud_on(&test_shapes::torus(0.05, 0.018, 80, 40), 0.002);
    assert_watertight(&run(&cloud, &ReconstructParams::default()), 1);
}

#[test]
fn a_hole_in_the_data_is_closed_and_marked() {
    let whole = cloud_on(&test_shapes::sphere(0.05, 4), 0.0015);
    let seen: Vec<usize> = (0..whole.len()).filter(|&i| whole.points[i].z > -0.04).collect();
    let mesh = run(&whole.select(&seen), &ReconstructParams::default());
    assert_watertight(&mesh, 0);
    for (v, observed) in mesh.vertices.iter().zip(&mesh.observed) {
        assert!(!observed || v.z > -0.044, "{v}");
    }
    assert!(mesh.observed.iter().any(|o| !o));
    let lowest = mesh.vertices.iter().map(|v| v.z).fold(0.0, f64::min);
    assert!(lowest > -0.055, "{lowest}");
}

/// Signed distance from two balls of 22 mm, 60 mm apart, with a neck of 5 mm between them.
fn dumbbell(p: &Vec3) -> f64 {
    let middle = Vec3::new(0.0, 0.0, 0.03);
    let ball = (p - middle).norm().min((p + middle).norm()) - 0.022;
    let neck = (p.x.hypot(p.y) - 0.005).max(p.z.abs() - 0.03);
    ball.min(neck)
}

#[test]
fn two_balls_joined_by_a_thin_neck_stay_one() {
    let bounds = crate::geometry::Aabb { min: Vec3::repeat(-0.06), max: Vec3::repeat(0.06) };
    let shape =
        crate::mesh::isosurface::Lattice::sample(&bounds, 0.0015, dumbbell).extract_isosurface();
    assert_watertight(&run(&cloud_on(&shape, 0.0015), &ReconstructParams::default()), 0);
}

#[test]
fn the_thesis_inflates_and_details_a_sphere() {
    let cloud = cloud_on(&test_shapes::sphere(0.05, 4), 0.0012);
    let params = ReconstructParams {
        inflate: InflateMethod::Thesis,
        detail: DetailMethod::Thesis,
        voxel_edge: 0.005,
        edge_length: 0.003,
        start_edge: 2.0,
        iterations: 10,
        ..ReconstructParams::default()
    };
    let mesh = run(&cloud, &params);
    assert_watertight(&mesh, 0);
    let rms = (mesh.vertices.iter().map(|v| (v.norm() - 0.05).powi(2)).sum::<f64>()
        / mesh.vertices.len() as f64)
        .sqrt();
    assert!(rms < 1e-3, "{rms}");
}

/// The error for a cloud that no mesh can be made of.
fn refuse(cloud: &Cloud) -> String {
    reconstruct(cloud, &ReconstructParams::default(), &Progress::silent()).unwrap_err().to_string()
}

#[test]
fn planes_and_handfuls_are_refused() {
    let mut plane = Cloud::default();
    for i in 0..400 {
        plane.push(Vec3::new(f64::from(i % 20), f64::from(i / 20), 0.0) * 1e-3, Vec3::z(), 1e-4, 1);
    }
    assert!(refuse(&plane).contains("plane"));
    assert!(refuse(&plane.select(&[1, 2, 3])).contains("3 usable points"));
    assert!(refuse(&Cloud::default()).contains("0 usable points"));
    let inside_out = {
        let mut cloud = cloud_on(&test_shapes::sphere(0.05, 3), 0.002);
        cloud.normals.iter_mut().for_each(|n| *n = -*n);
        cloud
    };
    assert!(refuse(&inside_out).contains("turned inwards"));
}

#[test]
fn one_and_two_threads_give_the_same_bits() {
    let cloud = cloud_on(&test_shapes::torus(0.05, 0.018, 60, 30), 0.003);
    // As text, where a vertex without standard deviation equals itself.
    let [one, two] = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        format!("{:?}", pool.install(|| run(&cloud, &ReconstructParams::default())))
    });
    assert!(one == two, "not the same bits");
}

#[test]
fn an_object_on_a_table_gets_its_flat_underside_and_nobody_claims_to_have_seen_it() {
    let whole = cloud_on(&test_shapes::sphere(0.05, 4), 0.0015);
    // A ball cut flat 30 mm below its middle, and its lowest 2 mm hidden.
    let mut cloud = Cloud::default();
    for i in (0..whole.len()).filter(|&i| whole.points[i].z > -0.028) {
        let point = whole.points[i] + Vec3::new(0.0, 0.0, 0.03);
        cloud.push(point, whole.normals[i], whole.sigma[i], whole.support[i]);
    }
    let on_table = ReconstructParams { support: Support::Table, ..ReconstructParams::default() };
    let mesh = run(&cloud, &on_table);
    assert_watertight(&mesh, 0);
    let lowest = mesh.vertices.iter().map(|v| v.z).fold(1.0, f64::min);
    assert!(lowest.abs() < 3e-4, "{lowest}");
    let under: Vec<usize> =
        (0..mesh.vertices.len()).filter(|&i| mesh.vertices[i].xy().norm() < 0.035).collect();
    let below = under.iter().filter(|&&i| mesh.vertices[i].z < 0.01);
    for &i in below {
        assert!(mesh.vertices[i].z.abs() < 3e-4, "{}", mesh.vertices[i]);
        assert!(!mesh.observed[i] && mesh.sigma[i].is_nan());
    }
    // The disc that a plane cuts from a ball: volume of the cap above it.
    let (r, h) = (0.05_f64, 0.08_f64);
    let expected = std::f64::consts::PI * h * h * (3.0 * r - h) / 3.0;
    assert!((mesh.volume() / expected - 1.0).abs() < 0.01, "{}", mesh.volume() / expected);
}

/// Signed distance from a box about the origin with these half edges.
fn box_distance(p: &Vec3, half: Vec3) -> f64 {
    let q = p.abs() - half;
    q.map(|v| v.max(0.0)).norm() + q.max().min(0.0)
}

/// A box of 60 x 40 x 20 mm, open at the top, with walls of `wall` metres.
fn tray(wall: f64) -> Mesh {
    let half = Vec3::new(0.035, 0.025, 0.015);
    let bounds = crate::geometry::Aabb { min: -half, max: half };
    crate::mesh::isosurface::Lattice::sample(&bounds, 0.0007, |p| {
        let outer = box_distance(p, Vec3::new(0.03, 0.02, 0.01));
        let inner = Vec3::new(0.03 - wall, 0.02 - wall, 0.01);
        outer.max(-box_distance(&(p - Vec3::z() * wall), inner))
    })
    .extract_isosurface()
}

/// Points of `cloud` of which no two of one side lie nearer than `spacing` (metres).
fn thinned(cloud: &Cloud, spacing: f64) -> Cloud {
    let mut kept: Vec<usize> = Vec::new();
    for i in 0..cloud.len() {
        let is_near_kept = kept.iter().any(|&j| {
            (cloud.points[i] - cloud.points[j]).norm() < spacing
                && cloud.normals[i].dot(&cloud.normals[j]) > 0.5
        });
        if !is_near_kept {
            kept.push(i);
        }
    }
    cloud.select(&kept)
}

#[test]
fn walls_of_one_and_a_half_spacings_stay_whole_in_noise() {
    use rand::{RngExt, SeedableRng};
    for (wall, spacing, noise) in [(0.002, 0.0013, 2e-5), (0.003, 0.002, 2e-4)] {
        let shape = tray(wall);
        let mut cloud = thinned(&cloud_on(&shape, 0.0007), spacing);
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        for i in 0..cloud.len() {
            let tilt = Vec3::from_fn(|_, _| random.random_range(-0.2..0.2));
            cloud.points[i] += cloud.normals[i] * random.random_range(-2.0..2.0) * noise;
            cloud.normals[i] = (cloud.normals[i] + tilt).normalize();
            cloud.sigma[i] = noise;
        }
        let mesh = run(&cloud, &ReconstructParams::default());
        assert_watertight(&mesh, 0);
        let ratio = mesh.volume() / shape.volume();
        assert!((ratio - 1.0).abs() < 0.1, "wall of {wall} m: {ratio} of the volume");
    }
}

#[test]
fn a_stray_sheet_adds_nothing() {
    let mut cloud = cloud_on(&test_shapes::sphere(0.05, 4), 0.0015);
    let clean = run(&cloud, &ReconstructParams::default()).volume();
    for i in 0..400 {
        let at = Vec3::new(f64::from(i % 20) - 10.0, f64::from(i / 20) - 10.0, 40.0) * 0.0015;
        cloud.push(at, Vec3::z(), 1e-4, 2);
    }
    let mesh = run(&cloud, &ReconstructParams::default());
    assert_watertight(&mesh, 0);
    assert!((mesh.volume() / clean - 1.0).abs() < 0.01, "{}", mesh.volume() / clean);
    assert!(mesh.vertices.iter().all(|v| v.z < 0.055));
}
