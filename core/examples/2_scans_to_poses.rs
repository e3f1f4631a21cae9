//! Scans that a robot took at poses which it does not know exactly are registered.
//!
//! `cargo run --release -p puffer_core --example 2_scans_to_poses`
//!
//! The scans are simulated, so that the true poses are known: the errors before and after, and the
//! verdict on each scan, are printed. Errors are root mean square distances between where the
//! reported or registered pose and the true pose put the points of the surface.

use puffer_core::assess::{PoseErrors, PosedHits, pose_errors};
use puffer_core::geometry::{Pose, Vec3};
use puffer_core::mesh::Mesh;
use puffer_core::register::{RegisterParams, register};
use puffer_core::scan::PreparedScan;
use puffer_core::simulate::{NoiseFamily, SimulateParams, SimulatedScans, objects, simulate};
use puffer_core::{Progress, Result};

fn main() -> Result<()> {
    // A laser striper on a lightweight robot, whose poses are a few millimetres off.
    let truth = objects::make_object("filter")?;
    let params = SimulateParams {
        family: NoiseFamily::P2,
        views: 8,
        point_spacing: 1.5e-3,
        profile_spacing: 1.5e-3,
        ..SimulateParams::default()
    };
    let simulated = simulate(&truth, &params, 1, &Progress::silent())?;

    let mut scans = Vec::new();
    for view in &simulated.views {
        scans.push(PreparedScan::new(&view.scan)?);
    }
    let robot: Vec<Pose> = simulated.views.iter().map(|view| view.reported_pose).collect();
    let sigma = simulated.pose_sigma;
    println!("{} scans; the robot states {:.1} mm", scans.len(), sigma.translation * 1e3);

    let params = RegisterParams::default();
    let registration = register(&scans, &robot, Some(sigma), &params, &Progress::silent())?;
    for (index, verdict) in registration.verdicts.iter().enumerate() {
        println!("scan {index}: {} ({})", verdict.status.word(), verdict.reason);
    }

    print_errors("before", &errors(&simulated, &robot, &truth)?);
    print_errors("after", &errors(&simulated, &registration.poses, &truth)?);
    Ok(())
}

/// The errors of `poses` against the true ones.
fn errors(simulated: &SimulatedScans, poses: &[Pose], truth: &Mesh) -> Result<PoseErrors> {
    let mut views = Vec::new();
    for (view, pose) in simulated.views.iter().zip(poses) {
        let hits = view.scan.returns().map(|i| Vec3::from(view.hits[i].map(f64::from))).collect();
        views.push(PosedHits { hits, truth: view.true_pose, estimate: *pose });
    }
    pose_errors(&views, truth, &Progress::silent())
}

fn print_errors(when: &str, errors: &PoseErrors) {
    println!("{when}: {:.3} mm, of it along the normals {:.3} mm", errors.full, errors.normal);
}
