//! What a goal of `model_object` may ask for.

use crate::common::processes::{Running, free_domain, run_turn};
use puffer_core::mesh::io::read_mesh;
use puffer_msgs::action::{ModelObject, ModelObjectFeedback, ModelObjectGoal};
use puffer_msgs::geometry_msgs::msg::Vector3;
use puffer_ros::{NoParams, Node, Outcome, RosArgs, Stop};
use std::path::Path;
use std::time::Duration;

/// Long enough for a loaded machine.
const LONG: Duration = Duration::from_secs(300);

/// A goal that asks for a region up to height `z` and a mean sigma, both metres.
fn goal(z: f64, sigma: f32) -> ModelObjectGoal {
    ModelObjectGoal {
        max_scans: 3,
        sigma,
        roi: Vector3 { x: 0.0, y: 0.0, z },
        ..ModelObjectGoal::default()
    }
}

/// Launched nodes that are ready for a goal, and a node that sends it.
async fn launched(folder: &Path, object: &str) -> (Running, Node<NoParams>) {
    let domain = free_domain();
    let call = ["launch", "--setup", "kr16_laser", "--object", object, "--out", "out"];
    let launch = Running::start(folder, domain, &call);
    launch.wait_for("[modeller]: ready");
    let args = RosArgs::default().with_domain(domain);
    (launch, Node::start("operator", args, Stop::new()).await.unwrap())
}

#[tokio::test(flavor = "multi_thread")]
async fn goals_follow_each_other_on_the_same_nodes_and_every_second_is_cancelled() {
    let _turn = run_turn().await;
    let folder = tempfile::tempdir().unwrap();
    let (launch, node) = launched(folder.path(), "mug").await;
    let client = node.action_client::<ModelObject>("model_object").unwrap();
    let goal = ModelObjectGoal { max_scans: 2, ..ModelObjectGoal::default() };
    for number in 1..=5 {
        let mut handle = client.send(&goal, LONG).await.unwrap().unwrap();
        if number % 2 == 0 {
            // The second goal is given up as soon as it plans, the fourth after its first scan.
            while handle.feedback().await.is_some_and(|told| match number {
                2 => told.phase != ModelObjectFeedback::PLANNING,
                _ => told.scans == 0,
            }) {}
            let given_up = handle.cancel(LONG).await.unwrap();
            assert!(given_up, "goal {number} had ended: {}", launch.said());
        }
        let outcome = handle.result(LONG).await.unwrap();
        match (number % 2, &outcome) {
            (0, Outcome::Canceled(_)) => {}
            (1, Outcome::Succeeded(result)) if result.scans == 2 => {}
            _ => panic!("goal {number}: {outcome:?}: {}", launch.said()),
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_region_bounds_the_mesh_and_a_sigma_out_of_reach_is_told() {
    let _turn = run_turn().await;
    let folder = tempfile::tempdir().unwrap();
    let (launch, node) = launched(folder.path(), "coffee").await;
    let client = node.action_client::<ModelObject>("model_object").unwrap();
    for wrong in [goal(-0.1, 0.0), goal(0.0, f32::NAN)] {
        assert!(client.send(&wrong, LONG).await.unwrap().is_none(), "{wrong:?} is no goal");
    }
    let handle = client.send(&goal(0.06, 1e-6), LONG).await.unwrap().unwrap();
    let outcome = handle.result(LONG).await.unwrap();
    let Outcome::Succeeded(result) = outcome else { panic!("{outcome:?}: {}", launch.said()) };
    assert_eq!(result.scans, 3);
    assert!(result.mean_sigma > 1e-6 && result.closed, "{result:?}");
    for text in ["the number of scans allowed is reached", "0.001 mm was not reached"] {
        assert!(result.reason.contains(text), "{}", result.reason);
    }
    let mesh = read_mesh(&folder.path().join(Path::new(&result.mesh_path))).unwrap();
    let top = mesh.vertices.iter().map(|v| v.z).fold(f64::NEG_INFINITY, f64::max);
    assert!((0.05..0.065).contains(&top), "the object goes on above the region: {top}");
}
