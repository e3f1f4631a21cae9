use super::*;
use crate::geometry::Vec3;
use crate::mesh::test_shapes;
use std::f64::consts::{PI, TAU};

fn cloud_of(points: impl IntoIterator<Item = Vec3>) -> Cloud {
    let mut cloud = Cloud::default();
    for point in points {
        cloud.push(point, Vec3::z(), 1e-4, 1);
    }
    cloud
}

/// A ball of 50 mm, its points spread evenly (Fibonacci's lattice).
fn ball(count: usize) -> Cloud {
    let turn = PI * (3.0 - 5f64.sqrt());
    cloud_of((0..count).map(|k| {
        let z = 1.0 - 2.0 * (k as f64 + 0.5) / count as f64;
        let (sin, cos) = (turn * k as f64).sin_cos();
        Vec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z) * 0.05
    }))
}

/// The triangles of `mesh` whose corners all satisfy `keep`.
fn part(mesh: &Mesh, keep: impl Fn(&Vec3) -> bool) -> Mesh {
    let triangles = mesh.triangles.iter().copied();
    let kept = triangles.filter(|t| t.iter().all(|v| keep(&mesh.vertices[*v as usize])));
    Mesh::new(mesh.vertices.clone(), kept.collect())
}

/// The upright rectangle between two corners, in the plane y = 0.
fn rectangle([x0, z0]: [f64; 2], [x1, z1]: [f64; 2]) -> Mesh {
    let corners = [[x0, z0], [x1, z0], [x1, z1], [x0, z1]];
    let vertices = corners.map(|[x, z]| Vec3::new(x, 0.0, z)).to_vec();
    Mesh::new(vertices, vec![[0, 1, 2], [0, 2, 3]])
}

/// Points of a square lattice on that rectangle.
fn lattice([x0, z0]: [f64; 2], [x1, z1]: [f64; 2], spacing: f64) -> Vec<Vec3> {
    let [columns, rows] = [x1 - x0, z1 - z0].map(|length| (length / spacing).round() as usize);
    let mut points = Vec::new();
    for i in 0..columns {
        for j in 0..rows {
            let [x, z] = [i, j].map(|k| (k as f64 + 0.5) * spacing);
            points.push(Vec3::new(x0 + x, 0.0, z0 + z));
        }
    }
    points
}

fn share(cloud: &Cloud, mesh: &Mesh) -> f64 {
    explained_share(cloud, mesh).unwrap()
}

#[test]
fn a_whole_ball_is_explained_whatever_was_not_measured() {
    let mesh = test_shapes::sphere(0.05, 4);
    let mut cloud = ball(4000);
    assert_eq!(share(&cloud, &mesh), 1.0);
    // Points of the support plane are known, not measured.
    for point in lattice([0.2, 0.2], [0.4, 0.4], 0.002) {
        cloud.push(point, Vec3::z(), f64::NAN, 0);
    }
    assert_eq!(share(&cloud, &mesh), 1.0);
    let support_alone = cloud.select(&(4000..cloud.len()).collect::<Vec<_>>());
    assert_eq!(explained_share(&support_alone, &mesh), None);
    assert_eq!(share(&ball(4000), &Mesh::default()), 0.0);
}

/// Distance between the points on the wall of a cup of 40 mm radius, metres.
const WALL_SPACING: f64 = 0.0015;
/// Points in a row round the wall.
const WALL_COLUMNS: usize = 168;

fn wall_point(column: usize, z: f64) -> Vec3 {
    let (sin, cos) = (TAU * column as f64 / WALL_COLUMNS as f64).sin_cos();
    Vec3::new(0.04 * cos, 0.04 * sin, z)
}

/// The wall of the cup from the bottom to `height` metres, open at both ends.
fn wall_mesh(height: f64) -> Mesh {
    let columns = 0..WALL_COLUMNS;
    let vertices = columns.clone().flat_map(|i| [wall_point(i, 0.0), wall_point(i, height)]);
    let triangles = columns.flat_map(|i| {
        let (left, right) = (2 * i as u32, 2 * ((i + 1) % WALL_COLUMNS) as u32);
        let [a, b, c, d] = [left, right, right + 1, left + 1];
        [[a, b, c], [a, c, d]]
    });
    Mesh::new(vertices.collect(), triangles.collect())
}

#[test]
fn half_of_a_cup_is_missing() {
    // The wall is measured up to 80 mm; the mesh reaches to three spacings below the middle.
    let mut points = Vec::new();
    for row in 0..(0.08 / WALL_SPACING).round() as usize {
        let z = (row as f64 + 0.5) * WALL_SPACING;
        points.extend((0..WALL_COLUMNS).map(|column| wall_point(column, z)));
    }
    let cloud = cloud_of(points);
    let reach = 3.0 * WALL_SPACING;
    let half = share(&cloud, &wall_mesh(0.04 - reach));
    assert!((half - 0.5).abs() < 0.05, "{half}");
    let [trusted, distrusted] =
        [0.05, 0.03].map(|height| ModelVerdict::new(None, &cloud, &wall_mesh(height - reach)));
    assert_eq!(trusted.distrust_reason(), None);
    let reason = distrusted.distrust_reason().unwrap();
    assert!(reason.contains("of the surface that was measured"), "{reason}");
}

#[test]
fn halves_measured_with_spacings_of_one_and_twenty_weigh_the_same() {
    let (dense, sparse) = (0.001, 0.02);
    let (left, right) = ([[-0.3, 0.0], [0.0, 0.3]], [[0.0, 0.0], [0.3, 0.3]]);
    let mut points = lattice(left[0], left[1], dense);
    points.extend(lattice(right[0], right[1], sparse));
    let cloud = cloud_of(points);
    let whole = rectangle(left[0], right[1]);
    assert_eq!(share(&cloud, &whole), 1.0);
    // A fifth of the sparse half lies within three spacings of the dense one, and its cells reach
    // over its border.
    let without_sparse = share(&cloud, &rectangle(left[0], left[1]));
    assert!((0.45..0.65).contains(&without_sparse), "{without_sparse}");
    let without_dense = share(&cloud, &rectangle(right[0], right[1]));
    assert!((0.4..0.6).contains(&without_dense), "{without_dense}");
    // 10 mm beside the points is far for the dense half, and near for the sparse one.
    let mut beside = whole;
    for vertex in &mut beside.vertices {
        vertex.y = 0.01;
    }
    let sparse_alone = share(&cloud, &beside);
    assert!((0.4..0.6).contains(&sparse_alone), "{sparse_alone}");
}

#[test]
fn a_fragment_and_lone_outliers() {
    let sphere = test_shapes::sphere(0.05, 4);
    let mut cloud = ball(4000);
    let fragment = part(&sphere, |v| v.z > 0.04);
    let cap = share(&cloud, &fragment);
    // A tenth of the ball, and three spacings beyond its border.
    assert!((0.08..0.2).contains(&cap), "{cap}");
    // Each outlier is one small cell, however large the gap round it is.
    for k in 0..40 {
        let (sin, cos) = (TAU * f64::from(k) / 40.0).sin_cos();
        cloud.push(Vec3::new(cos, sin, 0.0) * 0.07, Vec3::z(), 1e-4, 1);
    }
    let with_outliers = share(&cloud, &sphere);
    assert!((0.85..1.0).contains(&with_outliers), "{with_outliers}");
}

#[test]
fn threads_and_the_number_of_points_in_one_place_change_nothing() {
    let mesh = part(&test_shapes::sphere(0.05, 4), |v| v.z > 0.0);
    let cloud = ball(3000);
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| share(&cloud, &mesh))
    });
    assert_eq!(one, three);
    let mut heavy = cloud.clone();
    for _ in 0..3000 {
        heavy.push(Vec3::new(0.0, 0.0, -0.05), Vec3::z(), 1e-4, 1);
    }
    assert!((share(&heavy, &mesh) - share(&cloud, &mesh)).abs() < 0.02);
    assert_eq!(share(&cloud_of([Vec3::zeros(); 5]), &mesh), 0.0);
}

fn verdict(all: usize, accepted: usize, cells_explained: Option<f64>) -> ModelVerdict {
    ModelVerdict { scans: ScanCount::new(all, accepted), cells_explained }
}

#[test]
fn the_verdict_says_what_was_wrong_and_what_to_do() {
    for good in [verdict(4, 2, Some(0.5)), verdict(9, 9, None), verdict(0, 0, Some(1.0))] {
        assert_eq!(good.distrust_reason(), None, "{good:?}");
        assert!(!good.summary().contains("NOT"), "{}", good.summary());
    }
    let reason = verdict(42, 12, Some(0.123)).distrust_reason().unwrap();
    for text in ["12 of 42 scans (28.6 %)", "12.3 % of the surface", "check", "take more scans"] {
        assert!(reason.contains(text), "no {text} in {reason}");
    }
    let summary = verdict(42, 12, Some(0.9)).summary();
    let expected = "NOT trustworthy: 12 of 42 scans accepted (28.6 %), 90.0 % of the measured surface explained";
    assert_eq!(summary, expected);
}

#[test]
fn facts_tell_the_verdict_again() {
    for (all, accepted, cells_explained) in [(42, 12, Some(0.25)), (0, 0, Some(0.75)), (3, 3, None)]
    {
        let verdict = ModelVerdict { scans: ScanCount::new(all, accepted), cells_explained };
        let facts = verdict.to_json();
        assert_eq!(ModelVerdict::from_json(&facts), verdict);
        assert_eq!(facts["trustworthy"], verdict.distrust_reason().is_none());
        assert_eq!(facts["not_trustworthy_because"].is_null(), verdict.distrust_reason().is_none());
    }
    let facts = ModelVerdict { scans: ScanCount::new(4, 3), cells_explained: None }.to_json();
    assert_eq!((&facts["scans"], &facts["accepted"]), (&4.into(), &3.into()));
    assert_eq!(facts["share_of_scans_accepted"], 0.75);
    assert!(facts["share_of_cells_explained"].is_null());
}
