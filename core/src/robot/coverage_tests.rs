//! Which directions the set-ups can look from. The bars lie a little below what was found.

use super::tests::{cell, object, view};
use super::*;
use crate::geometry::{SensorModel, StereoModel, StriperModel, Vec3};

/// Share of the directions at these elevations (degrees, every 20 degrees of azimuth) that are
/// reached from home.
fn coverage(setup: &str, sensor: &SensorModel, elevations: &[f64]) -> f64 {
    let (cell, home, obstacle) = (cell(setup), home_configuration(setup).unwrap(), object());
    let (mut reached, mut asked) = (0, 0);
    for elevation in elevations {
        for azimuth in (0..360).step_by(20) {
            let (e, a) = (elevation.to_radians(), f64::from(azimuth).to_radians());
            let direction = Vec3::new(e.cos() * a.cos(), e.cos() * a.sin(), e.sin());
            let request = ReachabilityRequest {
                view: view(&direction, sensor.working_distance()),
                start: &home,
                sweep: sensor.sweep_length(),
                slide: slide_range(sensor, 0.15),
                obstacle: &obstacle,
                margin: 0.01,
            };
            asked += 1;
            match cell.check_reachability(&request).unwrap() {
                Reachability::Reachable(_) => reached += 1,
                Reachability::Unreachable { reason, .. } => {
                    println!("{elevation} {azimuth}: {reason}")
                }
            }
        }
    }
    f64::from(reached) / f64::from(asked)
}

#[test]
fn the_laser_sweeps_from_all_sides_of_the_table() {
    let sensor = SensorModel::Striper(StriperModel::SCANCONTROL);
    let share = coverage("kr16_laser", &sensor, &[10.0, 25.0, 40.0, 55.0, 75.0]);
    assert!(share >= 0.98, "{share}");
    let low = coverage("kr16_laser", &sensor, &[-10.0, 0.0]);
    assert!(low >= 0.9, "{low}");
}

#[test]
fn the_stereo_pair_sees_the_held_object_from_all_sides() {
    let sensor = SensorModel::Stereo(StereoModel::GUPPY);
    let share = coverage("omnirob_stereo", &sensor, &[-55.0, -30.0, 0.0, 30.0, 60.0, 85.0]);
    assert!(share >= 0.98, "{share}");
}
