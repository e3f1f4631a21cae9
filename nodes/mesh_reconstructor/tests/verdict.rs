//! The verdict on the whole: who asks for a mesh hears whether it is trustworthy, and has it by
//! force alone.

// The lints spare test functions only, not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

use puffer_core::geometry::{Cloud, Vec3};
use puffer_core::pipeline::cloud_hash;
use puffer_msgs::action::{ReconstructMesh, ReconstructMeshGoal};
use puffer_msgs::msg::ModelMesh;
use puffer_msgs::sensor_msgs::msg::PointCloud2;
use puffer_msgs::srv::{
    Reconstruct, ReconstructRequest, ReconstructResponse, SaveMesh, SaveMeshRequest,
    SaveMeshResponse,
};
use puffer_msgs::std_msgs::msg::Header;
use puffer_shell::bulk::{BulkSubscription, Delivery, Mode};
use puffer_shell::convert::cloud_message;
use puffer_shell::{NoParams, Node, Outcome, RosArgs, Stop, domain};
use std::path::Path;
use std::time::Duration;

/// Long enough for a loaded machine.
const SOON: Duration = Duration::from_secs(120);
/// Long enough for a mesh to come that is on its way.
const SHORTLY: Duration = Duration::from_secs(2);

/// Balls of 20 mm far from each other, their points spread evenly (Fibonacci's lattice).
fn balls(number: u32) -> Cloud {
    let (count, turn) = (1500, std::f64::consts::PI * (3.0 - 5f64.sqrt()));
    let mut cloud = Cloud::default();
    for ball in 0..number {
        for k in 0..count {
            let z = 1.0 - 2.0 * (f64::from(k) + 0.5) / f64::from(count);
            let (sin, cos) = (turn * f64::from(k)).sin_cos();
            let normal = Vec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z);
            cloud.push(normal * 0.02 + Vec3::x() * 0.1 * f64::from(ball), normal, 1e-4, 3);
        }
    }
    cloud.to_single_precision()
}

fn arguments(folder: &Path, domain: u16) -> RosArgs {
    let output = format!("mesh.output_folder:={}", folder.display());
    let words = ["--ros-args", "-p", &output].map(str::to_owned);
    RosArgs::parse(words).unwrap().with_domain(domain)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mesh_that_is_not_trustworthy_is_neither_written_nor_published_unless_forced() {
    let folder = tempfile::tempdir().unwrap();
    let domain = domain::free().unwrap();
    let stop = Stop::new();
    let running =
        tokio::spawn(mesh_reconstructor::run(arguments(folder.path(), domain), stop.clone()));
    let args = RosArgs::default().with_domain(domain);
    let caller = Node::<NoParams>::start("caller", args, Stop::new()).await.unwrap();
    let clouds = caller.bulk_publisher("filtered_cloud", Mode::Latched).unwrap();
    let meshes: BulkSubscription<ModelMesh> =
        caller.bulk_subscribe("model_mesh", Delivery::Newest).unwrap();
    let make = caller.action_client::<ReconstructMesh>("mesh_reconstructor/reconstruct_action");
    let make = make.unwrap();
    let ask = caller.client::<Reconstruct>("mesh_reconstructor/reconstruct").unwrap();
    let save = caller.client::<SaveMesh>("mesh_reconstructor/save_mesh").unwrap();
    let publish = async |cloud: &Cloud| {
        let message: PointCloud2 = cloud_message(cloud, Header::default());
        clouds.publish_message(&message).await.unwrap();
        cloud_hash(cloud)
    };
    let result = async |goal: ReconstructMeshGoal| {
        make.send(&goal, SOON).await.unwrap().unwrap().result(SOON).await.unwrap()
    };

    // One ball is explained, but too few scans were accepted.
    let cloud_hash = publish(&balls(1)).await;
    let goal = |accepted, force| ReconstructMeshGoal {
        cloud_hash: cloud_hash.clone(),
        scans: 10,
        accepted,
        force,
        ..ReconstructMeshGoal::default()
    };
    let outcome = result(goal(4, false)).await;
    let Outcome::Aborted(refused) = outcome else { panic!("{outcome:?}") };
    assert_eq!(refused.error_code, ReconstructResponse::NOT_TRUSTWORTHY);
    assert!(!refused.success && refused.mesh_path.is_empty() && refused.vertices > 0);
    assert!(refused.error_msg.contains("4 of 10 scans"), "{}", refused.error_msg);
    assert_eq!((refused.scans, refused.accepted), (10, 4));
    assert_eq!((refused.share_of_scans_accepted, refused.share_of_cells_explained), (0.4, 1.0));
    let path = folder.path().join("mesh.ply");
    assert!(!path.exists());

    // It can be had afterwards, by force alone.
    let wish = |force| SaveMeshRequest { path: "saved.ply".into(), force };
    let saved = save.call(&wish(false), SOON).await.unwrap();
    assert!(!saved.success && saved.message.contains("4 of 10 scans"), "{}", saved.message);
    assert_eq!(saved.error_code, SaveMeshResponse::NOT_TRUSTWORTHY);
    assert_eq!(saved.share_of_scans_accepted, 0.4);
    assert!(!folder.path().join("saved.ply").exists());
    assert!(save.call(&wish(true), SOON).await.unwrap().success);
    assert!(tokio::time::timeout(SHORTLY, meshes.next()).await.is_err(), "it was published");

    let outcome = result(goal(4, true)).await;
    let Outcome::Succeeded(forced) = outcome else { panic!("{outcome:?}") };
    assert!(forced.error_msg.contains("4 of 10 scans"), "{}", forced.error_msg);
    let saved = std::fs::read(folder.path().join("saved.ply")).unwrap();
    assert!(std::fs::read(&path).unwrap() == saved, "the saved mesh is another one");
    tokio::time::timeout(SOON, meshes.next()).await.unwrap().unwrap();
    let outcome = result(goal(5, false)).await;
    let Outcome::Succeeded(good) = outcome else { panic!("{outcome:?}") };
    assert!(good.error_msg.is_empty(), "{}", good.error_msg);

    // Of three balls a mesh of one explains a third. Nothing is known of the scans.
    publish(&balls(3)).await;
    std::fs::remove_file(&path).unwrap();
    let three = tokio::time::timeout(SOON, async {
        loop {
            let response = ask.call(&ReconstructRequest::default(), SOON).await.unwrap();
            if !response.success {
                return response;
            }
            // The cloud had not come yet.
            std::fs::remove_file(&path).unwrap();
        }
    });
    let response = three.await.unwrap();
    assert_eq!(response.error_code, ReconstructResponse::NOT_TRUSTWORTHY);
    assert!(response.message.contains("of the surface that was measured"), "{}", response.message);
    assert!((response.share_of_cells_explained - 1.0 / 3.0).abs() < 0.03, "{response:?}");
    assert!(response.share_of_scans_accepted.is_nan() && response.scans == 0);
    assert!(!path.exists());
    let request = ReconstructRequest { force: true, ..ReconstructRequest::default() };
    let response = ask.call(&request, SOON).await.unwrap();
    assert!(response.success && !response.message.is_empty() && path.exists(), "{response:?}");
    stop.stop();
    running.await.unwrap().unwrap();
}
