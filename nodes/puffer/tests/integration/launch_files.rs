//! The launch files of ROS 2, evaluated with a stand-in for `launch`: the nodes start with what
//! they give them.

use crate::common::processes::free_domain;
use std::process::Command;

#[test]
fn the_launch_files_start_the_nodes() {
    let check = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/independent/launch_check.py");
    let outcome = Command::new("python3")
        .arg(check)
        .env("PUFFER_BIN", crate::common::PUFFER)
        .env("ROS_DOMAIN_ID", free_domain().to_string())
        .output();
    let output = match outcome {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            println!("SKIPPED launch files: there is no python3");
            return;
        }
        outcome => outcome.unwrap(),
    };
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
}
