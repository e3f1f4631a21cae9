//! A run, its bag, its scans and the bag played into running nodes all give the same mesh, byte for
//! byte.

use crate::common::processes::{free_domain, wait_for_run_turn};
use crate::common::{PUFFER, json, puffer, stdout};
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// Nodes that hear a bag: all but the driver, whose part the bag plays.
const NODES: [&str; 5] =
    ["mesh_reconstructor", "cloud_filter", "nbv_planner", "scan_registrar", "modeller"];

/// Running nodes; dropping it ends them.
struct Nodes(Vec<Child>);

impl Nodes {
    fn start(params: &Path, domain: u16) -> Nodes {
        let children = NODES.iter().map(|name| {
            Command::new(PUFFER)
                // They end with their standard input, so whatever becomes of this test.
                .args(["node", "--with-parent", name, "--ros-args", "--params-file"])
                .arg(params)
                .env("ROS_DOMAIN_ID", domain.to_string())
                .stdin(Stdio::piped())
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap()
        });
        Nodes(children.collect())
    }
}

impl Drop for Nodes {
    fn drop(&mut self) {
        for node in &mut self.0 {
            drop(node.stdin.take());
            let _ = node.wait();
        }
    }
}

/// `run/params.yaml` with another folder for what comes out.
fn params_for(folder: &Path, from: &Path, to: &Path) {
    let text = fs::read_to_string(from.join("params.yaml")).unwrap();
    assert!(text.contains(&quoted(from)));
    fs::write(folder, text.replace(&quoted(from), &quoted(to))).unwrap();
}

/// A path as the parameter file has it.
fn quoted(path: &Path) -> String {
    format!("\"{}\"", path.canonicalize().unwrap().display())
}

/// Plays the bag into nodes of its own; the mesh that they make.
fn replayed(folder: &Path, run: &Path) -> Vec<u8> {
    let again = folder.join("again");
    fs::create_dir(&again).unwrap();
    let params = folder.join("again.yaml");
    params_for(&params, run, &again);
    let domain = free_domain();
    let nodes = Nodes::start(&params, domain);
    let played = Command::new(PUFFER)
        .args(["bag", "play", "--rate", "20", "--finish"])
        .arg(run.join("bag.mcap"))
        .env("ROS_DOMAIN_ID", domain.to_string())
        .output()
        .unwrap();
    drop(nodes);
    let said = String::from_utf8_lossy(&played.stderr);
    assert!(played.status.success(), "{said}");
    let path = String::from_utf8(played.stdout).unwrap();
    assert_eq!(Path::new(path.trim()), again.canonicalize().unwrap().join("mesh.ply"));
    fs::read(path.trim()).unwrap()
}

#[test]
fn a_bag_gives_the_mesh_of_its_run_byte_for_byte() {
    let _turn = wait_for_run_turn();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let options = ["--setup", "omnirob_stereo", "--object", "filter", "--seed", "5"];
    let quick = ["--max-scans", "3", "--speed-up", "20", "--out", "run", "--json"];
    let report = json(folder, &[&["model"], &options[..], &quick].concat());
    let run = folder.join("run");
    let live = fs::read(run.join("mesh.ply")).unwrap();
    assert!(live.windows(7).any(|w| w == b"seed 5\n"), "the seed is named");

    let info = json(folder, &["bag", "info", "run/bag.mcap", "--json"]);
    let count = |name: &str| {
        let topics = info["topics"].as_array().unwrap();
        topics.iter().find(|t| t["name"] == name).and_then(|t| t["count"].as_u64()).unwrap()
    };
    assert_eq!(info["damage"].as_array().map(Vec::len), Some(0), "{info}");
    let (start, end) = (info["start"].as_f64().unwrap(), info["end"].as_f64().unwrap());
    assert!(start < end && end < 1000.0, "the times are not those of the robot: {info}");
    assert_eq!(info["notes"]["setup"], "omnirob_stereo");
    assert_eq!(count("/points") as f64, report["scans"].as_f64().unwrap());
    for once in ["/registered_poses", "/filtered_cloud", "/model_mesh", "/tf_static"] {
        assert_eq!(count(once), 1, "{once}");
    }
    assert!(count("/clock") > 0 && count("/tf") > 0 && count("/rosout") > 0);

    stdout(folder, &["reconstruct", "run/bag.mcap", "-o", "bag.ply"]);
    assert!(fs::read(folder.join("bag.ply")).unwrap() == live, "reconstruct of the bag differs");
    stdout(folder, &["reconstruct", "run/scans", "-o", "scans.ply", "--seed", "5"]);
    assert!(fs::read(folder.join("scans.ply")).unwrap() == live, "that of the scans differs");
    stdout(folder, &["bag", "scans", "run/bag.mcap", "-o", "taken"]);
    stdout(folder, &["reconstruct", "taken", "-o", "taken.ply", "--seed", "5"]);
    assert!(fs::read(folder.join("taken.ply")).unwrap() == live, "that of the bag's scans differs");
    // It hangs on the parameters that the bag notes: others give another mesh.
    stdout(
        folder,
        &["reconstruct", "run/bag.mcap", "-o", "o.ply", "--set", "register.joint=false"],
    );
    assert!(fs::read(folder.join("o.ply")).unwrap() != live, "--set counts for nothing");
    assert!(replayed(folder, &run) == live, "the nodes make another mesh of the bag");
}

#[test]
fn what_is_no_bag_or_no_topic_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("a.mcap"), "no bag").unwrap();
    for (arguments, status, says) in [
        (&["bag", "info", "a.mcap"][..], 1, "is no MCAP bag"),
        (&["reconstruct", "a.mcap", "-o", "m.ply"], 1, "is no MCAP bag"),
        (&["reconstruct", "a.mcap", "-o", "m.ply", "--unit", "mm"], 2, "leave --unit out"),
        (&["bag", "play", "a.mcap", "--rate=-1"], 2, "rate"),
        (&["bag", "record", "-o", "a.bag"], 2, "must end in .mcap"),
        (&["bag", "record", "-o", "a.mcap"], 1, "create the file"),
        (&["bag", "record", "-o", "b.mcap", "/points"], 2, "expected TOPIC:TYPE"),
    ] {
        let output = puffer(folder, arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(status), "{arguments:?}: {said}");
        assert!(said.contains(says), "{arguments:?}: {said}");
    }
}
