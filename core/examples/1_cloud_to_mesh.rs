//! A cloud of points with normals becomes a watertight mesh.
//!
//! `cargo run --release -p puffer_core --example 1_cloud_to_mesh [CLOUD.ply [MESH.ply]]`
//!
//! Without a cloud, a simulated laser scans an object from eight sides, and the scans are combined
//! to one. Without a path for the mesh, it is written to the folder for temporary files.

use puffer_core::filter::{FilterParams, filter};
use puffer_core::geometry::Cloud;
use puffer_core::mesh::io::{read_cloud, write_mesh};
use puffer_core::mesh::{is_closed, is_two_manifold, self_intersections};
use puffer_core::reconstruct::{ReconstructParams, reconstruct};
use puffer_core::scan::PreparedScan;
use puffer_core::simulate::{NoiseFamily, SimulateParams, objects, simulate};
use puffer_core::{Progress, Result};
use std::path::PathBuf;

fn main() -> Result<()> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let cloud = match arguments.next() {
        Some(path) => read_cloud(&path)?,
        None => simulated_cloud()?,
    };
    println!("cloud: {} points", cloud.len());

    let mesh = reconstruct(&cloud, &ReconstructParams::default(), &Progress::silent())?;
    println!("mesh: {} vertices, {} triangles", mesh.vertices.len(), mesh.triangles.len());
    println!("closed: {}, two-manifold: {}", is_closed(&mesh), is_two_manifold(&mesh));
    println!("pairs of triangles that intersect: {}", self_intersections(&mesh).len());
    println!("volume: {:.1} cm^3", mesh.volume() * 1e6);

    let path = arguments.next().unwrap_or_else(|| std::env::temp_dir().join("puffer_mesh.ply"));
    write_mesh(&path, &mesh, &["made by the example 1_cloud_to_mesh".to_owned()])?;
    println!("written to {}", path.display());
    Ok(())
}

/// A cloud of simulated scans whose poses are exact (noise family P1).
fn simulated_cloud() -> Result<Cloud> {
    let truth = objects::make_object("filter")?;
    let params = SimulateParams {
        family: NoiseFamily::P1,
        views: 8,
        point_spacing: 1e-3,
        profile_spacing: 1e-3,
        ..SimulateParams::default()
    };
    let simulated = simulate(&truth, &params, 1, &Progress::silent())?;
    let mut scans = Vec::new();
    for view in &simulated.views {
        scans.push((PreparedScan::new(&view.scan)?, view.true_pose));
    }
    let posed: Vec<_> = scans.iter().map(|(scan, pose)| (scan, *pose)).collect();
    Ok(filter(&posed, None, &FilterParams::default(), &Progress::silent())?.cloud)
}
