//! Wrong input to nodes and runs, and processes that die: one clear message, no panic, nothing left
//! behind.

use crate::common::processes::{
    Running, SOON, assert_gone, eventually, free_domain, send, wait_for_run_turn,
};
use crate::common::{puffer, stdout};
use nix::sys::signal::Signal;
use puffer_core::geometry::{Pose, Scan};
use puffer_msgs::builtin_interfaces::msg::Time;
use puffer_msgs::msg::RegisteredScan;
use puffer_msgs::srv::{PlanView, PlanViewRequest, PlanViewResponse};
use puffer_msgs::std_msgs::msg::{Header, String as Text};
use puffer_ros::conversions::scan_message;
use puffer_ros::large_data::{Delivery, LargeDataPublisher, LargeDataSubscription, Retention};
use puffer_ros::{NoParams, Node, QosProfile, RosArgs, Stamp, Stop, Transform};
use std::path::Path;
use std::time::Duration;

const FAILED: i32 = 1;
const USAGE: i32 = 2;
const INTERRUPTED: i32 = 130;

async fn node(name: &str, domain: u16) -> Node<NoParams> {
    Node::start(name, RosArgs::default().with_domain(domain), Stop::new()).await.unwrap()
}

/// The program ends with `status` and one line that holds all of `says`.
fn refused(folder: &Path, arguments: &[&str], status: i32, says: &[&str]) {
    let mut program = Running::start(folder, free_domain(), arguments);
    let (ended, said) = program.end();
    assert_eq!(ended.code(), Some(status), "{arguments:?}: {said}");
    assert_eq!(said.lines().count(), 1, "{arguments:?}: {said}");
    for text in says {
        assert!(said.contains(text), "{arguments:?}: no {text:?} in {said}");
    }
}

#[test]
fn arguments_of_nodes() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (name, text) in [
        ("unknown.yaml", "nbv_planner: {ros__parameters: {planner: {speed: 1}}}"),
        ("range.yaml", "nbv_planner: {ros__parameters: {planner: {margin: 7}}}"),
        ("broken.yaml", "nbv_planner: ["),
    ] {
        std::fs::write(folder.join(name), text).unwrap();
    }
    let cases: [(&[&str], i32, &[&str]); 10] = [
        (&["-p", "planner.speed:=1"], FAILED, &["planner.speed: unknown", "margin"]),
        (&["-p", "planner.margin:=7"], FAILED, &["planner.margin: 7", "allowed are 0 to 0.5"]),
        (&["-p", "planner.margin:=wide"], FAILED, &["planner.margin", "float"]),
        (&["-p", "planner.sensor:=nose"], FAILED, &["planner.sensor", "striper, stereo"]),
        (&["--params-file", "unknown.yaml"], FAILED, &["planner.speed: unknown", "unknown.yaml"]),
        (&["--params-file", "range.yaml"], FAILED, &["out of range", "range.yaml"]),
        (&["--params-file", "broken.yaml"], USAGE, &["broken.yaml", "YAML"]),
        (&["--params-file", "none.yaml"], USAGE, &["cannot read", "none.yaml"]),
        (&["-r", "points"], USAGE, &["from:=to"]),
        (&["-r", "__node:=no name"], FAILED, &["no name"]),
    ];
    for (arguments, status, says) in cases {
        let call = [&["node", "nbv_planner", "--ros-args"], arguments].concat();
        refused(folder, &call, status, says);
    }
    refused(folder, &["node", "moon"], USAGE, &["no node moon", "mock_driver"]);
    refused(folder, &["node", "modeller", "fast"], USAGE, &["fast", "--ros-args"]);
    let call = ["node", "mock_driver", "--ros-args", "-p", "driver.object:=unicorn"];
    refused(folder, &call, FAILED, &["driver.object", "unicorn", "coffee"]);
}

#[test]
fn arguments_of_runs() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for command in ["model", "launch"] {
        refused(folder, &[command, "--setup", "moon"], USAGE, &["moon", "kr16_laser"]);
        let call = [command, "--setup", "kr16_laser", "--object", "unicorn"];
        refused(folder, &call, FAILED, &["unicorn", "coffee"]);
        let call = [command, "--setup", "kr16_laser", "--object", "none.ply"];
        refused(folder, &call, FAILED, &["none.ply"]);
    }
    for (setting, says) in [
        ("nbv_planner:planner.margin=7", "out of range"),
        ("nbv_planner:planner.speed=1", "no parameter planner.speed"),
        ("moon:planner.margin=0.1", "no node moon"),
        ("planner.margin", "NODE:NAME=VALUE"),
    ] {
        refused(folder, &["model", "--set", setting], USAGE, &[says]);
    }
    let call = ["launch", "--setup", "kr16_laser", "--driver", "none", "--object", "mug"];
    refused(folder, &call, USAGE, &["--object", "mock driver"]);
    for number in ["233", "999", "-1"] {
        let output = puffer(folder, &["model", "--domain", number]);
        assert_eq!(output.status.code(), Some(USAGE), "{number}");
    }
    std::fs::create_dir(folder.join("taken")).unwrap();
    std::fs::write(folder.join("taken/mesh.ply"), "mine").unwrap();
    refused(folder, &["model", "--out", "taken"], USAGE, &["taken", "holds something already"]);
    for (environment, says) in
        [(("ROS_DOMAIN_ID", "999"), "0 to 232"), (("RMW_IMPLEMENTATION", "rmw_moon"), "rmw_moon")]
    {
        let output = std::process::Command::new(crate::common::PUFFER)
            .args(["launch", "--setup", "kr16_laser"])
            .env(environment.0, environment.1)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(USAGE), "{said}");
        assert!(said.contains(says) && said.lines().count() == 1, "{said}");
    }
}

#[test]
fn a_domain_in_use() {
    let folder = tempfile::tempdir().unwrap();
    let domain = free_domain();
    let port = 7400 + 250 * domain + 11;
    let _other = std::net::UdpSocket::bind(("0.0.0.0", port)).unwrap();
    let text = domain.to_string();
    let call = ["model", "--domain", &text, "--out", "run"];
    refused(folder.path(), &call, FAILED, &[&format!("domain {domain} is in use"), "--domain"]);
    assert!(!folder.path().join("run").exists());
}

const BROKEN: &str = r#"<robot name="broken">
  <link name="base"/>
  <joint name="hinge" type="fixed"><parent link="base"/><child link="gripper_x"/></joint>
</robot>"#;

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_description_with_a_missing_link() {
    let folder = tempfile::tempdir().unwrap();
    let domain = free_domain();
    let mut planner = Running::start(folder.path(), domain, &["node", "nbv_planner"]);
    let node = node("robot", domain).await;
    let description = node.publisher::<Text>("robot_description", QosProfile::Latched).unwrap();
    description.publish(&Text { data: BROKEN.to_owned() }).unwrap();
    description.wait_for_readers(1, SOON).await.unwrap();
    planner.wait_for("gripper_x");
    let client = node.client::<PlanView>("nbv_planner/plan_view").unwrap();
    let answer = client.call(&PlanViewRequest::default(), SOON).await.unwrap();
    assert!(!answer.success);
    assert_eq!(answer.error_code, PlanViewResponse::NO_ROBOT);
    for text in ["robot_description", "gripper_x"] {
        assert!(answer.message.contains(text), "{}", answer.message);
    }
    planner.signal(Signal::SIGTERM);
    assert_eq!(planner.end().0.code(), Some(INTERRUPTED));
}

/// Publishes a scan until the registrar's answer to it comes.
async fn answer(
    points: &LargeDataPublisher,
    scans: &LargeDataSubscription<RegisteredScan>,
    second: i32,
) -> RegisteredScan {
    let scan = Scan { points: vec![[0.0, 0.0, 0.3]; 8], width: 0, origins: Vec::new() };
    let stamp = Time { sec: second, nanosec: 0 };
    let header = Header { stamp, frame_id: "sensor_optical".to_owned() };
    let cloud = scan_message(&scan, header);
    let asked = async {
        loop {
            points.publish_message(&cloud).await.unwrap();
            let answered = async {
                loop {
                    let scan = scans.next().await.unwrap();
                    if scan.header.stamp.sec == second {
                        return scan;
                    }
                }
            };
            if let Ok(scan) = tokio::time::timeout(Duration::from_secs(5), answered).await {
                return scan;
            }
        }
    };
    tokio::time::timeout(SOON, asked).await.unwrap()
}

/// The scan was refused, with all of `says` in the reason.
fn assert_scan_refused(scan: RegisteredScan, says: &[&str]) {
    assert_eq!(scan.status, RegisteredScan::REFUSED);
    for text in says {
        assert!(scan.reason.contains(text), "no {text:?} in: {}", scan.reason);
    }
}

fn sensor_transform(second: i32) -> Transform {
    Transform {
        parent: "object".to_owned(),
        child: "sensor_optical".to_owned(),
        stamp: Stamp::new(second, 0),
        pose: Pose::translation(0.0, 0.0, 0.3),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn transforms_and_descriptions_that_never_come() {
    let folder = tempfile::tempdir().unwrap();
    let domain = free_domain();
    let call = ["node", "scan_registrar", "--ros-args", "-p", "scan.tf_deadline:=0.3"];
    let mut registrar = Running::start(folder.path(), domain, &call);
    let node = node("sensor", domain).await;
    let points = node.large_data_publisher("points", Retention::Queue { depth: 4 }).unwrap();
    let scans = node.large_data_subscribe("registered_scan", Delivery::Every).unwrap();
    points.wait_for_readers(1, SOON).await.unwrap();
    let none = answer(&points, &scans, 10).await;
    assert_scan_refused(none, &["no transform object <- sensor_optical within 0.3 s", "unknown"]);

    let tf = node.tf_broadcaster().unwrap();
    // They are repeated, as a robot does, so that a late subscriber gets them as well.
    let sender = tokio::spawn(async move {
        loop {
            tf.send(&[sensor_transform(10), sensor_transform(20)]).unwrap();
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    });
    assert_scan_refused(
        answer(&points, &scans, 15).await,
        &["robot_description", "scan.cut_bodies"],
    );
    let far = answer(&points, &scans, 1_700_000_000).await;
    assert_scan_refused(far, &["object <- sensor_optical at 1700000000", "from 10", "to 20"]);

    let description = node.publisher::<Text>("robot_description", QosProfile::Latched).unwrap();
    description.publish(&Text { data: BROKEN.to_owned() }).unwrap();
    description.wait_for_readers(1, SOON).await.unwrap();
    assert_scan_refused(answer(&points, &scans, 16).await, &["robot_description", "gripper_x"]);
    sender.abort();
    registrar.signal(Signal::SIGINT);
    assert_eq!(registrar.end().0.code(), Some(INTERRUPTED));
}

/// Starts a run and waits for `scans` scans.
fn run_until(folder: &Path, scans: usize) -> Running {
    let call = ["model", "--object", "sphere", "--speed-up", "100", "--out", "run"];
    let run = Running::start(folder, 0, &call);
    let file = folder.join("run/scans/poses.json");
    eventually(&format!("{scans} scans"), || {
        let text = std::fs::read_to_string(&file).unwrap_or_default();
        let held: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
        (held["views"].as_array().map_or(0, Vec::len) >= scans).then_some(())
    });
    run
}

/// The report is whole, and a mesh comes of the scans.
fn assert_usable(folder: &Path, scans: usize) -> serde_json::Value {
    let text = std::fs::read_to_string(folder.join("run/report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(report["scans"].as_u64().unwrap() as usize >= scans, "{text}");
    assert!(report["views"].as_array().unwrap().len() >= scans, "{text}");
    let call = ["reconstruct", "run/scans", "-o", "mesh.ply", "--json"];
    let mesh: serde_json::Value = serde_json::from_str(&stdout(folder, &call)).unwrap();
    assert_eq!(mesh["closed"], true, "{mesh}");
    report
}

#[test]
fn ctrl_c_in_the_middle_of_a_run() {
    let _turn = wait_for_run_turn();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut run = run_until(folder, 3);
    let nodes = run.nodes(6);
    run.signal(Signal::SIGINT);
    let (status, said) = run.end();
    assert_eq!(status.code(), Some(INTERRUPTED), "{said}");
    assert!(said.contains("what was measured is in"), "{said}");
    assert_gone(&nodes);
    let report = assert_usable(folder, 3);
    assert_eq!(report["outcome"], "cancelled", "{report}");
}

#[test]
fn a_driver_that_dies() {
    let _turn = wait_for_run_turn();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut run = run_until(folder, 3);
    let nodes = run.nodes(6);
    let (_, driver) = nodes.iter().find(|(name, _)| name == "mock_driver").unwrap();
    send(*driver, Signal::SIGKILL);
    let (status, said) = run.end();
    assert_eq!(status.code(), Some(FAILED), "{said}");
    let last = said.lines().last().unwrap();
    for text in ["puffer: mock_driver has ended", "SIGKILL", "what was measured is in"] {
        assert!(last.contains(text), "{said}");
    }
    assert_gone(&nodes);
    let report = assert_usable(folder, 3);
    assert!(report["failure"].as_str().unwrap().contains("mock_driver"), "{report}");
}

fn start_launch(folder: &Path, more: &[&str]) -> Running {
    let call = [&["launch", "--setup", "kr16_laser"], more].concat();
    Running::start(folder, free_domain(), &call)
}

#[test]
fn launched_nodes_end_together() {
    let _turn = wait_for_run_turn();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut mock = start_launch(folder, &[]);
    mock.wait_for("[mock_driver]: ready");
    let nodes = mock.nodes(6);
    let (_, filter) = nodes.iter().find(|(name, _)| name == "cloud_filter").unwrap();
    send(*filter, Signal::SIGKILL);
    let (status, said) = mock.end();
    assert_eq!(status.code(), Some(FAILED), "{said}");
    assert!(said.contains("puffer: cloud_filter has ended"), "{said}");
    assert_gone(&nodes);

    let mut real = start_launch(folder, &["--driver", "none"]);
    real.wait_for("[modeller]: ready");
    let nodes = real.nodes(5);
    real.signal(Signal::SIGINT);
    let (status, said) = real.end();
    assert_eq!(status.code(), Some(INTERRUPTED), "{said}");
    assert_gone(&nodes);

    // Killed without a chance to say goodbye, it leaves nobody behind either.
    let mut killed = start_launch(folder, &["--driver", "none"]);
    let nodes = killed.nodes(5);
    killed.signal(Signal::SIGKILL);
    killed.end();
    assert_gone(&nodes);
}

#[test]
fn a_node_that_does_not_start_ends_the_launch() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("p.yaml"), "modeller: {ros__parameters: {session: {pace: 1}}}")
        .unwrap();
    let call = ["launch", "--setup", "omnirob_stereo", "--params", "p.yaml"];
    let mut launch = Running::start(folder, free_domain(), &call);
    let (status, said) = launch.end();
    assert_eq!(status.code(), Some(FAILED), "{said}");
    for text in ["session.pace: unknown", "p.yaml", "puffer: modeller has ended"] {
        assert!(said.contains(text), "{said}");
    }
    let output = puffer(folder, &["launch", "--setup", "omnirob_stereo", "--params", "none.yaml"]);
    assert_eq!(output.status.code(), Some(USAGE));
    assert!(String::from_utf8_lossy(&output.stderr).contains("none.yaml"));
}
