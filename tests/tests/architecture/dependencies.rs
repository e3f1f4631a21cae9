//! Which crates may depend on which.

use crate::source::{crate_folders, root};
use std::fs;
use std::process::Command;

/// In the name of any crate that speaks ROS or runs an event loop.
const ROS_WORDS: [&str; 5] = ["ros2", "rustdds", "tokio", "cyclors", "dds"];
/// Folders below `nodes/` that hold no node.
const NO_NODES: [&str; 3] = ["ros", "puffer", "bench"];
/// The only node that computes with poses itself: it simulates the robot.
const SIMULATING_NODE: &str = "mock_driver";

#[test]
fn the_dependency_tree_of_core_holds_no_ros() {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    let output = Command::new(cargo)
        .args(["tree", "-p", "puffer_core", "-e", "normal", "--prefix", "none", "--offline"])
        .current_dir(root())
        .output()
        .unwrap();
    let tree = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(tree.contains("nalgebra"), "not a dependency tree: {tree}");
    assert_eq!(ros_crates(&tree), Vec::<&str>::new());
}

#[test]
fn no_node_but_the_driver_computes_with_poses_itself() {
    let mut nodes = 0;
    for folder in crate_folders() {
        let name = folder.file_name().unwrap().to_string_lossy().into_owned();
        if !folder.parent().unwrap().ends_with("nodes") || NO_NODES.contains(&name.as_str()) {
            continue;
        }
        nodes += 1;
        let manifest = fs::read_to_string(folder.join("Cargo.toml")).unwrap();
        let allowed = name == SIMULATING_NODE;
        assert!(allowed || !depends_on(&manifest, "nalgebra"), "{name} depends on nalgebra");
    }
    assert!(nodes > 3, "{nodes} nodes were found");
}

#[test]
fn planted_dependencies_are_found() {
    assert_eq!(ros_crates("serde v1.0.0\nrustdds v0.11.4\nadd_one v1"), ["rustdds"]);
    let manifest = "[package]\nname = \"nalgebra_free\"\n[dependencies]\nserde.workspace = true\n\
                    [dev-dependencies]\nnalgebra.workspace = true\n";
    assert!(!depends_on(manifest, "nalgebra"));
    for line in ["nalgebra.workspace = true", "nalgebra = \"0.35\""] {
        let planted = manifest.replace("[dependencies]", &format!("[dependencies]\n{line}"));
        assert!(depends_on(&planted, "nalgebra"));
    }
}

/// The crates of a `cargo tree` that core must not depend on.
fn ros_crates(tree: &str) -> Vec<&str> {
    let names = tree.lines().filter_map(|line| line.split(' ').next());
    names.filter(|name| ROS_WORDS.iter().any(|word| name.contains(word))).collect()
}

/// Whether a manifest names a crate under `[dependencies]`.
fn depends_on(manifest: &str, name: &str) -> bool {
    let lines = manifest.lines().skip_while(|line| line.trim() != "[dependencies]").skip(1);
    let mut entries = lines.take_while(|line| !line.starts_with('['));
    entries.any(|entry| entry.split(['.', '=', ' ']).next() == Some(name))
}
