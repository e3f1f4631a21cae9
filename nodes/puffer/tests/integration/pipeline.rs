//! From scans to a measured mesh, with the program itself.

use crate::common::{json, stdout};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

fn figure(values: &Value, key: &str) -> f64 {
    values[key].as_f64().unwrap_or_else(|| panic!("no number {key} in {values}"))
}

fn assert_sound(mesh: &Value, genus: i64) {
    for gate in ["closed", "two_manifold", "oriented"] {
        assert_eq!(mesh[gate], true, "{gate}: {mesh}");
    }
    assert_eq!((&mesh["genus"], &mesh["components"]), (&genus.into(), &1.into()), "{mesh}");
}

fn simulate(folder: &Path, name: &str, threads: &str) {
    let options = ["--views", "8", "--seed", "3", "-o", name, "--threads", threads];
    stdout(folder, &[&["simulate", "--object", "torus"], &options[..]].concat());
}

/// Every file of a folder by its name.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(|e| e.unwrap());
    entries
        .map(|e| (e.file_name().to_string_lossy().into_owned(), fs::read(e.path()).unwrap()))
        .collect()
}

#[test]
fn a_simulated_torus_comes_back_and_threads_change_no_byte() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // The same name, because the truth tells where the clouds are.
    simulate(folder, "1/scans", "1");
    simulate(folder, "2/scans", "2");
    for (a, b) in [("1/scans", "2/scans"), ("1/scans.truth", "2/scans.truth")] {
        let (a, b) = (contents(&folder.join(a)), contents(&folder.join(b)));
        assert!(a.len() >= 3 && a == b, "{:?} differ from {:?}", a.keys(), b.keys());
    }
    let result =
        json(folder, &["reconstruct", "1/scans", "-o", "1.ply", "--threads", "1", "--json"]);
    assert_sound(&result, 1);
    stdout(folder, &["reconstruct", "2/scans", "-o", "2.ply", "--threads", "2"]);
    let same = fs::read(folder.join("1.ply")).unwrap() == fs::read(folder.join("2.ply")).unwrap();
    assert!(same, "the mesh depends on the number of threads");
    let measured =
        json(folder, &["evaluate", "1.ply", "--truth", "1/scans.truth/truth.ply", "--json"]);
    assert_sound(&measured, 1);
    assert_eq!(measured["self_intersecting_faces"], 0);
    assert!(figure(&measured, "crms_rms") < 0.3, "{measured}");
}

#[test]
fn the_real_bunny_is_closed_and_true_and_has_its_ears() {
    let Some(data) = std::env::var_os("PUFFER_DATA") else {
        println!("SKIPPED real bunny scans: PUFFER_DATA is not set");
        return;
    };
    let bunny = Path::new(&data).join("bunny");
    let path = |name: &str| bunny.join(name).to_string_lossy().into_owned();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let result = json(folder, &["reconstruct", &path("bun.conf"), "-o", "bunny.ply", "--json"]);
    assert_sound(&result, 0);
    let truth = path("bun_zipper.ply");
    let measured = json(folder, &["evaluate", "bunny.ply", "--truth", &truth, "--json"]);
    assert_sound(&measured, 0);
    assert_eq!(measured["self_intersecting_faces"], 0);
    assert!(figure(&measured, "completeness_mean") < 0.5, "{measured}");
    assert!(figure(&measured, "accuracy_covered_mean") < 0.5, "{measured}");
    // The share of the truth farther from the result than the holes' threshold: the ears are there.
    assert!(figure(&measured, "holes") <= 0.01, "{measured}");
}
