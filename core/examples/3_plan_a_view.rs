//! The next best view is planned, a scan is taken from it, and the next view is planned.
//!
//! `cargo run --release -p puffer_core --example 3_plan_a_view`
//!
//! A simulated stereo camera models an object on a table. The robot is a function that accepts
//! every view from above the table; `4_a_robot_of_your_own` shows how a real one is asked, and
//! `puffer_core::planner` puts both together.

use puffer_core::Result;
use puffer_core::geometry::{Pose, SensorModel, StereoModel};
use puffer_core::simulate::{NoiseFamily, SimulateParams, Simulator, objects};
use puffer_core::view::{ReachedView, RefusedView, ViewParams, ViewSpace, next_view};

fn main() -> Result<()> {
    let truth = objects::make_object("filter")?;
    let params = SimulateParams { family: NoiseFamily::P3, ..SimulateParams::default() };
    let simulator = Simulator::new(&truth, &params, 1)?;

    // The region of interest; what lies below the table is excluded from it.
    let region = truth.aabb().padded(0.03);
    let sensor = SensorModel::Stereo(StereoModel::GUPPY);
    let mut space = ViewSpace::new(sensor, region, &ViewParams::default())?;
    space.exclude_below(0.0);

    for number in 0..3 {
        let plan = next_view(&space, &mut |pose| take_if_above_table(pose));
        println!("coverage {:.2}, {} candidates", plan.coverage, plan.candidates.len());
        let Some(view) = plan.chosen else {
            println!("no view is left: {}", plan.done.map_or_else(String::new, |done| done.text));
            break;
        };
        let eye = view.pose.translation.vector;
        println!(
            "view {number}: from ({:.2}, {:.2}, {:.2}) m, gain {:.1}, {} new voxels expected",
            eye.x, eye.y, eye.z, view.gain, view.expected_new
        );
        let scan = simulator.scan(number, &view.pose);
        space.integrate(&scan.scan, &scan.true_pose)?;
    }

    let counts = space.counts();
    println!(
        "voxels: {} occupied, {} free, {} unknown",
        counts.occupied, counts.free, counts.unknown
    );
    Ok(())
}

/// Stands for the robot: how it takes the view `pose` (`object_from_sensor`), or why it cannot.
fn take_if_above_table(pose: &Pose) -> std::result::Result<ReachedView, RefusedView> {
    if pose.translation.z < 0.0 {
        return Err(RefusedView { kind: "below", reason: "below the table".to_owned() });
    }
    Ok(ReachedView { pose: *pose, duration: 1.0 })
}
