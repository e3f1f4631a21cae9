//! Times of the innermost parts of core: `cargo bench -p puffer_bench`, or
//! `cargo bench -p puffer_bench -- NAME` for those whose name contains NAME.
//!
//! All inputs are made here, so that figures of two commits can be compared on one machine.

// The lints spare test functions only.
#![allow(clippy::unwrap_used)]
#![allow(missing_docs)]

use criterion::{Criterion, criterion_group, criterion_main};
use puffer_core::Progress;
use puffer_core::filter::{FilterParams, filter};
use puffer_core::geometry::{Aabb, KdTree, Pose, Scan, Twist, Vec3, exp};
use puffer_core::mesh::isosurface::Lattice;
use puffer_core::mesh::{Mesh, self_intersections};
use puffer_core::register::{PairScan, RegisterParams, align_pair};
use puffer_core::scan::PreparedScan;
use puffer_core::simulate::{NoiseFamily, SimulateParams, SimulatedScans, objects, simulate};
use puffer_core::voxel::BlockGrid;
use std::hint::black_box;
use std::time::Duration;

/// Scans of the object `filter` by the laser on the KR16, of about 20,000 points each.
fn simulated_scans(views: usize) -> SimulatedScans {
    let truth = objects::make_object("filter").unwrap();
    let params = SimulateParams {
        family: NoiseFamily::P2K,
        views,
        point_spacing: 0.7e-3,
        profile_spacing: 0.7e-3,
        ..SimulateParams::default()
    };
    simulate(&truth, &params, 1, &Progress::silent()).unwrap()
}

/// The scan with the most points of a simulation.
fn largest_scan() -> Scan {
    let views = simulated_scans(8).views.into_iter();
    views.map(|view| view.scan).max_by_key(|scan| scan.returns().count()).unwrap()
}

/// Nearest neighbours in the points of one scan, from points beside it.
fn kd_tree(criterion: &mut Criterion) {
    let points = PreparedScan::new(&largest_scan()).unwrap().points;
    let queries: Vec<Vec3> = points.iter().step_by(17).map(|p| p.add_scalar(3e-4)).collect();
    let tree = KdTree::new(&points);
    let mut group = criterion.benchmark_group("kd_tree");
    group.bench_function("build", |bench| bench.iter(|| KdTree::new(black_box(&points))));
    group.bench_function("nearest", |bench| {
        bench.iter(|| queries.iter().filter_map(|q| tree.nearest(q)).map(|n| n.1).sum::<f64>());
    });
    group.bench_function("nearest_16", |bench| {
        bench.iter(|| queries.iter().map(|q| tree.nearest_n(q, 16).len()).sum::<usize>());
    });
    group.bench_function("within_2_mm", |bench| {
        bench.iter(|| queries.iter().map(|q| tree.within(q, 2e-3).len()).sum::<usize>());
    });
    group.finish();
}

/// Rays through a grid of 0.3 m with voxels of 2 mm.
fn ray_walk(criterion: &mut Criterion) {
    let bounds = Aabb { min: Vec3::repeat(-0.15), max: Vec3::repeat(0.15) };
    let grid: BlockGrid<u32> = BlockGrid::new(&bounds, 2e-3).unwrap();
    let origin = Vec3::new(-0.4, 0.05, 0.1);
    let targets = (0..1000).map(|i| {
        let (column, row) = (f64::from(i % 40), f64::from(i / 40));
        Vec3::new(0.15, -0.1 + 0.005 * column, -0.1 + 0.008 * row)
    });
    let rays: Vec<Vec3> = targets.map(|target| (target - origin).normalize()).collect();
    criterion.bench_function("ray_walk/1000_rays", |bench| {
        bench.iter(|| {
            rays.iter().map(|ray| grid.walk_ray(&origin, ray, 0.0, 1.0).count()).sum::<usize>()
        });
    });
}

/// Normals and noise of one scan.
fn normals(criterion: &mut Criterion) {
    let scan = largest_scan();
    criterion.bench_function("normals/one_scan", |bench| {
        bench.iter(|| PreparedScan::new(black_box(&scan)).unwrap());
    });
}

/// ICP of two overlapping scans, from 2 mm and 0.5 degrees off.
fn pair_alignment(criterion: &mut Criterion) {
    let simulated = simulated_scans(26);
    let params = RegisterParams::default();
    let view = &simulated.views[0];
    let other = simulated.views[1..]
        .iter()
        .min_by(|a, b| {
            let [a, b] = [a, b].map(|v| v.true_pose.rotation.angle_to(&view.true_pose.rotation));
            a.total_cmp(&b)
        })
        .unwrap();
    let [moving, fixed] = [view, other].map(|view| {
        PairScan::new(&PreparedScan::new(&view.scan).unwrap(), simulated.pose_sigma, &params)
    });
    let error = exp(&Twist::new(1e-3, -1e-3, 1e-3, 5e-3, -5e-3, 5e-3));
    let guess: Pose = other.true_pose.inverse() * view.true_pose * error;
    criterion.bench_function("register/one_pair", |bench| {
        bench
            .iter(|| align_pair(&moving, &fixed, black_box(&guess), simulated.pose_sigma, &params));
    });
}

/// Quadric fits and outliers of the filter over three scans.
fn quadric_fits(criterion: &mut Criterion) {
    let simulated = simulated_scans(3);
    let prepared: Vec<(PreparedScan, Pose)> = simulated
        .views
        .iter()
        .map(|view| (PreparedScan::new(&view.scan).unwrap(), view.true_pose))
        .collect();
    let scans: Vec<(&PreparedScan, Pose)> =
        prepared.iter().map(|(scan, pose)| (scan, *pose)).collect();
    let params = FilterParams::default();
    let mut group = criterion.benchmark_group("filter");
    group.sample_size(10).measurement_time(Duration::from_secs(10));
    group.bench_function("three_scans", |bench| {
        bench.iter(|| filter(&scans, None, &params, &Progress::silent()).unwrap());
    });
    group.finish();
}

/// The signed distance of a torus of 8 cm, negative inside.
fn torus(point: &Vec3) -> f64 {
    let ring = point.x.hypot(point.y) - 0.03;
    ring.hypot(point.z) - 0.01
}

fn torus_lattice() -> Lattice {
    let bounds = Aabb { min: Vec3::repeat(-0.045), max: Vec3::repeat(0.045) };
    Lattice::sample(&bounds, 1e-3, torus)
}

/// Marching tetrahedra over a lattice of 90 cells a side.
fn isosurface(criterion: &mut Criterion) {
    let lattice = torus_lattice();
    criterion.bench_function("isosurface/torus", |bench| {
        bench.iter(|| black_box(&lattice).extract_isosurface());
    });
}

/// The check that no two triangles of the torus intersect.
fn self_intersection(criterion: &mut Criterion) {
    let mesh: Mesh = torus_lattice().extract_isosurface();
    criterion.bench_function("self_intersections/torus", |bench| {
        bench.iter(|| self_intersections(black_box(&mesh)));
    });
}

criterion_group!(
    benches,
    kd_tree,
    ray_walk,
    normals,
    pair_alignment,
    quadric_fits,
    isosurface,
    self_intersection
);
criterion_main!(benches);
