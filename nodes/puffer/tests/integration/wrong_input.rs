//! Wrong input of every kind ends in one clear message and exit status 1 or 2: no panic, no file
//! left behind.

use crate::common::{PUFFER, puffer, stdout};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const FAILED: i32 = 1;
const USAGE: i32 = 2;

/// Every path below a folder.
fn listing(folder: &Path) -> BTreeSet<std::path::PathBuf> {
    let mut found = BTreeSet::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path.clone());
            }
            found.insert(path);
        }
    }
    found
}

/// One message on standard error, beside plain progress, that holds every text of `says`.
fn assert_refused(output: &Output, status: i32, says: &[&str]) {
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(status), "{says:?}: {error}");
    assert!(!error.contains("panicked"), "{error}");
    assert!(output.stdout.is_empty(), "{}", String::from_utf8_lossy(&output.stdout));
    let message: Vec<&str> =
        error.lines().filter(|line| !line.ends_with(" ...") && !line.contains(" took ")).collect();
    let of_clap = message.first().is_some_and(|line| line.starts_with("error: "));
    let one_line = message.len() == 1 && message[0].starts_with("puffer: ");
    assert!(of_clap || one_line, "not one message: {error}");
    for text in says {
        assert!(message.join("\n").contains(text), "no {text:?} in: {error}");
    }
}

fn refused(folder: &Path, arguments: &[&str], status: i32, says: &[&str]) {
    let before = listing(folder);
    assert_refused(&puffer(folder, arguments), status, says);
    assert_eq!(listing(folder), before, "{arguments:?} left something behind");
}

/// An ASCII PLY with normals along z.
fn ply(points: &[[f64; 3]]) -> String {
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex {}\n", points.len());
    for name in ["x", "y", "z", "nx", "ny", "nz"] {
        writeln!(text, "property float {name}").unwrap();
    }
    text += "end_header\n";
    for [x, y, z] in points {
        writeln!(text, "{x} {y} {z} 0 0 1").unwrap();
    }
    text
}

fn plane() -> Vec<[f64; 3]> {
    (0..900).map(|i| [f64::from(i % 30) * 1e-3, f64::from(i / 30) * 1e-3, 0.5]).collect()
}

const IDENTITY: &str = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";

/// Writes a scan folder `scans` of one view; `pose` stands as the value of object_from_sensor.
fn write_scan(folder: &Path, cloud: &str, pose: &str) {
    let scans = folder.join("scans");
    fs::create_dir_all(&scans).unwrap();
    fs::write(scans.join("view_000.ply"), cloud).unwrap();
    let text = format!(
        r#"{{"format": "puffer-scans-1", "views": [{{"cloud": "view_000.ply"{}}}]}}"#,
        if pose.is_empty() { String::new() } else { format!(r#", "object_from_sensor": {pose}"#) }
    );
    fs::write(scans.join("poses.json"), text).unwrap();
}

/// Scans that `puffer reconstruct` makes a mesh of.
fn good_scans(folder: &Path) {
    stdout(folder, &["simulate", "--object", "sphere", "--views", "8", "-o", "good"]);
}

#[test]
fn missing_and_malformed_files() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for input in ["none", "none.ply", "none.conf"] {
        refused(folder, &["reconstruct", input, "-o", "m.ply"], FAILED, &[input]);
    }
    refused(folder, &["evaluate", "none.ply", "--truth", "t.ply"], FAILED, &["none.ply"]);
    refused(folder, &["render", "none.ply", "-o", "p.png"], FAILED, &["none.ply"]);
    for from in ["1,foo,-1,0.5", "1,2", "1,2,3,", "0,0,0", "1,inf,0", "1,NaN,0"] {
        let arguments = ["render", "none.ply", "-o", "p.png", "--from", from];
        refused(folder, &arguments, USAGE, &["--from", from, "1,-1,0.5"]);
    }
    let whole = ply(&plane());
    fs::write(folder.join("cut.ply"), &whole[..whole.len() / 2]).unwrap();
    fs::write(folder.join("head.ply"), &whole[..40]).unwrap();
    fs::write(folder.join("text.ply"), "no PLY at all").unwrap();
    for input in ["cut.ply", "head.ply", "text.ply"] {
        refused(folder, &["reconstruct", input, "-o", "m.ply"], FAILED, &[input]);
        refused(folder, &["filter", input, "-o", "c.ply"], FAILED, &[input]);
        refused(folder, &["render", input, "-o", "p.png"], FAILED, &[input]);
    }
}

#[test]
fn clouds_that_describe_no_volume() {
    let millimetres: Vec<[f64; 3]> = plane().iter().map(|p| p.map(|v| v * 1e3)).collect();
    let far: Vec<[f64; 3]> = millimetres.iter().map(|p| p.map(|v| v * 100.0)).collect();
    let cases: [(&str, Vec<[f64; 3]>, &str); 5] = [
        ("empty", vec![], ""),
        ("one", vec![[0.1, 0.2, 0.5]], ""),
        ("nan", vec![[f64::NAN; 3]; 100], ""),
        ("plane", plane(), "plane"),
        ("millimetres", far, "millimetres? use --unit mm"),
    ];
    for (name, points, says) in cases {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let file = format!("{name}.ply");
        let text = ply(&points).replace("NaN", "nan");
        fs::write(folder.join(&file), &text).unwrap();
        refused(folder, &["reconstruct", &file, "-o", "m.ply"], FAILED, &[&file, says]);
        write_scan(folder, &text, IDENTITY);
        let named = if name == "plane" { "" } else { "view_000" };
        refused(folder, &["reconstruct", "scans", "-o", "m.ply"], FAILED, &["scans", named, says]);
    }
}

#[test]
fn poses_that_are_none() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let cases = [
        ("", "lacks \"object_from_sensor\""),
        ("[[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]", "object_from_sensor"),
        ("[[1,0,0,0],[0,1,0,0]]", "four rows"),
        ("[[1,0,0,900],[0,1,0,0],[0,0,1,0],[0,0,0,1]]", "millimetres? use --unit mm"),
    ];
    for (pose, says) in cases {
        write_scan(folder, &ply(&plane()), pose);
        for command in [["reconstruct", "m.ply"], ["register", "p.json"], ["filter", "c.ply"]] {
            let says = ["poses.json", "view_000.ply", says];
            refused(folder, &[command[0], "scans", "-o", command[1]], FAILED, &says);
        }
    }
    fs::write(folder.join("scans/poses.json"), "{\"format\": ").unwrap();
    let says = ["poses.json", "not JSON"];
    refused(folder, &["reconstruct", "scans", "-o", "m.ply"], FAILED, &says);
    fs::remove_file(folder.join("scans/poses.json")).unwrap();
    refused(folder, &["reconstruct", "scans", "-o", "m.ply"], FAILED, &["poses.json"]);
}

#[test]
fn parameters_that_are_unknown_or_out_of_range() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_scan(folder, &ply(&plane()), IDENTITY);
    for (setting, says) in [
        ("filter.speed=1", "filter.speed"),
        ("motor.speed=1", "no group motor"),
        ("register.radius=7", "out of range"),
        ("register.radius=far", "float"),
        ("register.method=magic", "point_to_plane"),
        ("radius", "expected NAME=VALUE"),
    ] {
        let call = ["reconstruct", "scans", "-o", "m.ply", "--set", setting];
        refused(folder, &call, USAGE, &[says]);
    }
    for (text, says) in [
        ("register:\n  speed: 1\n", "register.speed"),
        ("register:\n  radius: -1\n", "out of range"),
        ("register:\n  radius: [1]\n", "float"),
        ("register: 3\n", "register"),
        ("a: [", "not valid YAML"),
    ] {
        fs::write(folder.join("p.yaml"), text).unwrap();
        let call = ["reconstruct", "scans", "-o", "m.ply", "--params", "p.yaml"];
        refused(folder, &call, USAGE, &["p.yaml", says]);
    }
    let call = ["reconstruct", "scans", "-o", "m.ply", "--params", "none.yaml"];
    refused(folder, &call, FAILED, &["none.yaml"]);
}

#[test]
fn outputs_that_cannot_be() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_scan(folder, &ply(&plane()), IDENTITY);
    for (command, output) in [
        ("reconstruct", "mesh.xyz"),
        ("reconstruct", "mesh"),
        ("reconstruct", "none/mesh.ply"),
        ("register", "poses.txt"),
        ("register", "none/poses.json"),
        ("filter", "cloud.stl"),
        ("filter", "none/cloud.ply"),
    ] {
        refused(folder, &[command, "scans", "-o", output], USAGE, &[output]);
    }
}

#[test]
fn no_space_to_write() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    good_scans(folder);
    // Ignored, the signal of the limit becomes an error of the write, as a full disk's is.
    let script = r#"trap '' XFSZ; ulimit -f 8; exec "$0" reconstruct good -o m.ply"#;
    let before = listing(folder);
    let limited =
        Command::new("sh").args(["-c", script, PUFFER]).current_dir(folder).output().unwrap();
    assert_refused(&limited, FAILED, &["cannot write m.ply"]);
    assert_eq!(listing(folder), before, "a partial file was left behind");
    if !Path::new("/dev/full").exists() {
        println!("SKIPPED full disk: there is no /dev/full");
        return;
    }
    std::os::unix::fs::symlink("/dev/full", folder.join("full.ply")).unwrap();
    let says = ["cannot write full.ply", "free some space"];
    refused(folder, &["reconstruct", "good", "-o", "full.ply"], FAILED, &says);
}

#[test]
fn calls_that_mean_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for call in [
        &["gibberish"][..],
        &[],
        &["reconstruct"],
        &["reconstruct", "scans"],
        &["reconstruct", "scans", "-o", "m.ply", "--poses", "perhaps"],
    ] {
        let output = puffer(folder, call);
        assert_eq!(output.status.code(), Some(USAGE), "{call:?}");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(said.contains("Usage: puffer") || said.contains("--help"), "{said}");
        assert!(!said.contains("panicked"), "{said}");
    }
    let call = ["objects", "--threads", "0"];
    refused(folder, &call, USAGE, &["--threads 0"]);
    let call = ["simulate", "--object", "unicorn", "-o", "s"];
    refused(folder, &call, FAILED, &["unicorn"]);
    let call = ["simulate", "--object", "sphere", "-o", "s", "--views", "0"];
    refused(folder, &call, USAGE, &["views"]);
    let call = ["simulate", "--object", "sphere", "-o", "s", "--noise", "P9"];
    refused(folder, &call, USAGE, &["P9", "P2K"]);
    let call = ["simulate", "--object", "sphere", "-o", "s", "--setup", "moon"];
    refused(folder, &call, USAGE, &["moon"]);
}
