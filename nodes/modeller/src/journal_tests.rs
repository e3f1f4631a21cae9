//! What a journal leaves in its folder.

use crate::journal::Journal;
use crate::params::{ModellerParams, Params, SensorChoice};
use puffer_core::geometry::Scan;
use puffer_core::mesh::io::Unit;
use puffer_core::scan::SensorKind;
use puffer_core::scan_files::read_scans;
use puffer_msgs::msg::RegisteredScan;
use puffer_msgs::srv::PlanViewResponse;
use puffer_msgs::std_msgs::msg::Header;
use puffer_ros::Stamp;
use puffer_ros::conversions::scan_message;
use serde_json::{Map, Value, json};
use std::path::Path;
use std::time::Duration;

fn params(folder: &Path) -> Params {
    let modeller = ModellerParams {
        run_folder: folder.display().to_string(),
        sensor: SensorChoice::Stereo,
        ..ModellerParams::default()
    };
    Params { modeller, ..Params::default() }
}

fn report(folder: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(folder.join("report.json")).unwrap()).unwrap()
}

/// A registered scan of two points with the robot's pose `x` metres along the first axis.
fn registered_scan(id: u32, status: u8, x: f64) -> RegisteredScan {
    let scan = Scan { points: vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], ..Scan::default() };
    let mut message = RegisteredScan {
        id,
        status,
        reason: "as the prior".into(),
        cloud: scan_message(&scan, Header::default()),
        ..RegisteredScan::default()
    };
    message.prior.position.x = x;
    message.prior.orientation.w = 1.0;
    message.object_from_sensor.covariance[0] = 1e-8;
    message
}

#[test]
fn a_view_gathers_its_plan_its_notes_and_the_verdict_on_its_scan() {
    let folder = tempfile::tempdir().unwrap();
    let mut journal = Journal::create(&params(folder.path()), Stamp::new(10, 0)).unwrap();
    for gain in [7.0, 5.0] {
        let plan = PlanViewResponse { expected_gain: gain, ..PlanViewResponse::default() };
        journal.begin_view(&plan);
        journal.note("move_seconds", 1.5);
    }
    // A newer verdict on the same scan takes the place of the first.
    journal.keep(&registered_scan(0, RegisteredScan::DEFERRED, 0.25)).unwrap();
    journal.keep(&registered_scan(0, RegisteredScan::ACCEPTED, 0.25)).unwrap();
    journal.add_stage_time("plan", Duration::from_secs(2));
    journal.add_stage_time("move", Duration::from_secs(1));
    journal.add_stage_time("plan", Duration::from_secs(3));
    let facts = Map::from_iter([("outcome".to_owned(), json!("modelled"))]);
    journal.write(Stamp::new(70, 0), &facts).unwrap();

    let report = report(folder.path());
    let views = report["views"].as_array().unwrap();
    assert_eq!(views.len(), 2);
    assert_eq!(
        (&views[0]["expected_gain"], &views[1]["expected_gain"]),
        (&json!(7.0), &json!(5.0))
    );
    assert_eq!(views[1]["move_seconds"], 1.5);
    assert_eq!(views[0].get("scan"), None);
    assert_eq!(views[1]["scan"], 0);
    assert_eq!(views[1]["verdict"]["status"], "accepted");
    assert_eq!(views[1]["verdict"]["points"], 2);
    assert_eq!(report["stage_seconds"], json!({ "plan": 5.0, "move": 1.0 }));
    let seconds = report["simulated_seconds"].as_f64().unwrap();
    assert!((seconds - 60.0).abs() < 1e-9, "{seconds}");
    assert_eq!(report["outcome"], "modelled");
    assert!(!folder.path().join("report.json.part").exists());
}

#[test]
fn the_scan_folder_holds_the_newest_version_of_each_scan_that_was_judged() {
    let folder = tempfile::tempdir().unwrap();
    let mut journal = Journal::create(&params(folder.path()), Stamp::ZERO).unwrap();
    journal.begin_view(&PlanViewResponse::default());
    journal.keep(&registered_scan(0, RegisteredScan::DEFERRED, 0.25)).unwrap();
    let mut unjudged = registered_scan(1, RegisteredScan::REFUSED, 0.5);
    unjudged.object_from_sensor.covariance = [0.0; 36];
    journal.keep(&unjudged).unwrap();
    journal.keep(&registered_scan(2, RegisteredScan::ACCEPTED, 0.75)).unwrap();
    journal.keep(&registered_scan(0, RegisteredScan::ACCEPTED, 0.125)).unwrap();

    let set = read_scans(&folder.path().join("scans"), Unit::Metre).unwrap();
    assert_eq!(set.sensor, Some(SensorKind::Stereo));
    let found: Vec<_> =
        set.views.iter().map(|v| (v.name.as_str(), v.object_from_sensor.translation.x)).collect();
    assert_eq!(found, [("view_000", 0.125), ("view_002", 0.75)]);
    assert_eq!(set.views[0].scan.points, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
}

#[test]
fn without_a_folder_nothing_is_written_and_nothing_fails() {
    let mut journal = Journal::create(&Params::default(), Stamp::ZERO).unwrap();
    assert_eq!(journal.folder(), "");
    journal.keep(&registered_scan(0, RegisteredScan::ACCEPTED, 0.0)).unwrap();
    journal.write(Stamp::ZERO, &Map::new()).unwrap();
}

#[test]
fn a_folder_that_cannot_be_made_is_told() {
    let file = tempfile::NamedTempFile::new().unwrap();
    assert!(Journal::create(&params(file.path()), Stamp::ZERO).is_err());
}
