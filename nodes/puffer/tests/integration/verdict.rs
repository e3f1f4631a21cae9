//! A mesh that is not trustworthy is told, and written only where that is wanted.

use crate::common::processes::wait_for_run_turn;
use crate::common::{json, puffer, stdout};
use puffer_core::geometry::{Cloud, Vec3};
use puffer_core::mesh::io::write_cloud;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Output;

const FAILED: i32 = 1;

/// Scans of a box, 5 of 8 in each other's places: most of them fit nothing where they are said to
/// be.
fn scans_that_do_not_fit(folder: &Path) {
    let how = ["--noise", "P3", "--views", "8", "--seed", "3", "-o", "scans"];
    stdout(folder, &[&["simulate", "--object", "box"], &how[..]].concat());
    let path = folder.join("scans/poses.json");
    let mut poses: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let views = &mut poses["views"].as_array_mut().unwrap()[3..];
    let clouds: Vec<Value> = views.iter().map(|view| view["cloud"].clone()).collect();
    for (k, view) in views.iter_mut().enumerate() {
        view["cloud"] = clouds[(k + 1) % clouds.len()].clone();
    }
    fs::write(&path, poses.to_string()).unwrap();
}

/// Three balls of 20 mm far from each other, their points spread evenly (Fibonacci's lattice).
fn three_balls(path: &Path) {
    let (count, turn) = (2000, std::f64::consts::PI * (3.0 - 5f64.sqrt()));
    let mut cloud = Cloud::default();
    for ball in 0..3 {
        for k in 0..count {
            let z = 1.0 - 2.0 * (f64::from(k) + 0.5) / f64::from(count);
            let (sin, cos) = (turn * f64::from(k)).sin_cos();
            let normal = Vec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z);
            cloud.push(normal * 0.02 + Vec3::x() * 0.1 * f64::from(ball), normal, 1e-4, 3);
        }
    }
    write_cloud(path, &cloud, &[]).unwrap();
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn scans_most_of_which_are_refused_give_no_mesh_unless_forced() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    scans_that_do_not_fit(folder);
    let call = ["reconstruct", "scans", "-o", "m.ply"];
    let output = puffer(folder, &[&call[..], &["--json"]].concat());
    assert_eq!(output.status.code(), Some(FAILED), "{}", said(&output));
    for text in ["of 8 scans", "at least half must be", "--force"] {
        assert!(said(&output).contains(text), "no {text} in {}", said(&output));
    }
    assert!(!folder.join("m.ply").exists());
    let result: Value = serde_json::from_slice(&output.stdout).unwrap();
    let (accepted, share) = (result["accepted"].as_u64().unwrap(), 0.125);
    assert_eq!((&result["scans"], &result["trustworthy"]), (&8.into(), &false.into()));
    assert!((1..4).contains(&accepted), "{result}");
    assert_eq!(result["share_of_scans_accepted"], share * accepted as f64);
    assert!(result["share_of_cells_explained"].as_f64().unwrap() > 0.5, "{result}");
    assert!(result["not_trustworthy_because"].as_str().unwrap().contains("of 8 scans"));
    assert!(result["mesh"].is_null());
    assert_eq!(result["size_mm"].as_array().unwrap().len(), 3);
    assert!(result["volume_cm3"].as_f64().unwrap() > 0.0);

    let forced = puffer(folder, &[&call[..], &["--force"]].concat());
    assert!(forced.status.success(), "{}", said(&forced));
    assert!(said(&forced).contains("warning") && said(&forced).contains("of 8 scans"));
    assert!(String::from_utf8_lossy(&forced.stdout).contains("NOT trustworthy"));
    assert!(folder.join("m.ply").exists());

    // The corrected poses are what register is asked for; it tells the share beside them.
    let registered = puffer(folder, &["register", "scans", "-o", "p.json", "--json"]);
    assert!(registered.status.success() && folder.join("p.json").exists());
    assert!(said(&registered).contains("of 8 scans"), "{}", said(&registered));
    let registered: Value = serde_json::from_slice(&registered.stdout).unwrap();
    assert_eq!((&registered["scans"], &registered["accepted"]), (&8.into(), &accepted.into()));
    assert_eq!(registered["share_of_scans_accepted"], result["share_of_scans_accepted"]);
}

#[test]
fn bodies_that_the_mesh_leaves_out_are_missed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    three_balls(&folder.join("balls.ply"));
    let call = ["reconstruct", "balls.ply", "-o", "m.ply"];
    let output = puffer(folder, &[&call[..], &["--json"]].concat());
    assert_eq!(output.status.code(), Some(FAILED), "{}", said(&output));
    assert!(said(&output).contains("% of the surface that was measured"), "{}", said(&output));
    let result: Value = serde_json::from_slice(&output.stdout).unwrap();
    let share = result["share_of_cells_explained"].as_f64().unwrap();
    assert!((share - 1.0 / 3.0).abs() < 0.03, "{result}");
    assert!(!folder.join("m.ply").exists());
    // As the reason says.
    let more = ["--set", "reconstruct.components=3", "--json"];
    let result = json(folder, &[&call[..], &more].concat());
    assert_eq!(result["share_of_cells_explained"], 1.0);
    assert_eq!((&result["trustworthy"], &result["mesh"]), (&true.into(), &"m.ply".into()));
    for key in ["scans", "accepted", "share_of_scans_accepted", "not_trustworthy_because"] {
        assert!(result[key].is_null(), "{key}: {result}");
    }
}

#[test]
fn a_run_that_is_not_trustworthy_keeps_what_was_measured_and_no_mesh() {
    let _turn = wait_for_run_turn();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // No scan lies on the map with all of its points: the first alone is accepted.
    let strict = ["--set", "scan_registrar:register.min_overlap=1", "--max-scans", "3"];
    let what = ["--object", "filter", "--setup", "omnirob_stereo", "--speed-up", "20", "--no-bag"];
    let call = [&["model", "--out", "run", "--json"], &strict[..], &what[..]].concat();
    let output = puffer(folder, &call);
    assert_eq!(output.status.code(), Some(FAILED), "{}", said(&output));
    for text in ["1 of 3 scans", "run/scans -o mesh.ply --force"] {
        assert!(said(&output).contains(text), "no {text} in {}", said(&output));
    }
    let result: Value = serde_json::from_slice(&output.stdout).unwrap();
    let run = folder.join("run");
    let report: Value =
        serde_json::from_slice(&fs::read(run.join("report.json")).unwrap()).unwrap();
    for told in [&result, &report] {
        assert_eq!((&told["scans"], &told["accepted"]), (&3.into(), &1.into()), "{told}");
        assert_eq!(told["trustworthy"], false);
        let share = told["share_of_scans_accepted"].as_f64().unwrap();
        assert!((share - 1.0 / 3.0).abs() < 1e-6, "{share}");
        assert!(told["share_of_cells_explained"].is_number(), "{told}");
    }
    assert_eq!((&report["mesh"], &report["evaluation"]), (&Value::Null, &Value::Null));
    for mesh in ["mesh.ply", "mesh.glb", "mesh.png"] {
        assert!(!run.join(mesh).exists(), "there is a {mesh}");
    }
    // As the reason says.
    stdout(folder, &["reconstruct", "run/scans", "-o", "mesh.ply", "--force"]);

    let call = [&["model", "--out", "forced", "--force"], &strict[..], &what[..]].concat();
    let forced = puffer(folder, &call);
    assert!(forced.status.success(), "{}", said(&forced));
    assert!(said(&forced).contains("warning: the model is not trustworthy"), "{}", said(&forced));
    let table = String::from_utf8(forced.stdout).unwrap();
    for text in ["NOT trustworthy: 1 of 3", "cRMS", "accuracy", "completeness"] {
        assert!(table.contains(text), "no {text} in {table}");
    }
    for mesh in ["mesh.ply", "mesh.glb", "mesh.png"] {
        assert!(folder.join("forced").join(mesh).exists(), "there is no {mesh}");
    }
}
