//! The verdict on a mesh: who asks for one is told whether it is trustworthy, and gets one that is
//! not only by force.

// The lints spare test functions only, not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;

use common::{ANSWER_DEADLINE, Reconstructor, ball};
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
use puffer_ros::Outcome;
use puffer_ros::conversions::cloud_message;
use puffer_ros::large_data::{Delivery, LargeDataSubscription, Retention};
use std::time::Duration;

/// Time within which a mesh that is published arrives.
const PUBLISH_TIME: Duration = Duration::from_secs(2);

/// Balls of 20 mm far from each other.
fn balls(number: u32) -> Cloud {
    let mut cloud = Cloud::default();
    for i in 0..number {
        cloud.extend(&ball(1500, 0.02, Vec3::x() * 0.1 * f64::from(i)));
    }
    cloud.to_single_precision()
}

/// Asks for a mesh of the cloud with this hash, of 10 scans of which so many were accepted.
fn goal(cloud_hash: &str, accepted: u32, force: bool) -> ReconstructMeshGoal {
    ReconstructMeshGoal {
        cloud_hash: cloud_hash.to_owned(),
        scans: 10,
        accepted,
        force,
        ..ReconstructMeshGoal::default()
    }
}

fn save_request(force: bool) -> SaveMeshRequest {
    SaveMeshRequest { path: "saved.ply".into(), force }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mesh_that_is_not_trustworthy_is_neither_written_nor_published_unless_forced() {
    let reconstructor = Reconstructor::start();
    let caller = reconstructor.join("caller").await;
    let clouds = caller.large_data_publisher("filtered_cloud", Retention::Latched).unwrap();
    let meshes: LargeDataSubscription<ModelMesh> =
        caller.large_data_subscribe("model_mesh", Delivery::Newest).unwrap();
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
        make.send(&goal, ANSWER_DEADLINE)
            .await
            .unwrap()
            .unwrap()
            .result(ANSWER_DEADLINE)
            .await
            .unwrap()
    };

    // One ball is explained, but too few scans were accepted.
    let cloud_hash = publish(&balls(1)).await;
    let outcome = result(goal(&cloud_hash, 4, false)).await;
    let Outcome::Aborted(refused) = outcome else { panic!("{outcome:?}") };
    assert_eq!(refused.error_code, ReconstructResponse::NOT_TRUSTWORTHY);
    assert!(!refused.success && refused.mesh_path.is_empty() && refused.vertices > 0);
    assert!(refused.error_msg.contains("4 of 10 scans"), "{}", refused.error_msg);
    assert_eq!((refused.scans, refused.accepted), (10, 4));
    assert_eq!((refused.share_of_scans_accepted, refused.share_of_cells_explained), (0.4, 1.0));
    let path = reconstructor.path("mesh.ply");
    assert!(!path.exists());

    // It can be had afterwards, by force alone.
    let saved = save.call(&save_request(false), ANSWER_DEADLINE).await.unwrap();
    assert!(!saved.success && saved.message.contains("4 of 10 scans"), "{}", saved.message);
    assert_eq!(saved.error_code, SaveMeshResponse::NOT_TRUSTWORTHY);
    assert_eq!(saved.share_of_scans_accepted, 0.4);
    assert!(!reconstructor.path("saved.ply").exists());
    assert!(save.call(&save_request(true), ANSWER_DEADLINE).await.unwrap().success);
    assert!(tokio::time::timeout(PUBLISH_TIME, meshes.next()).await.is_err(), "it was published");

    let outcome = result(goal(&cloud_hash, 4, true)).await;
    let Outcome::Succeeded(forced) = outcome else { panic!("{outcome:?}") };
    assert!(forced.error_msg.contains("4 of 10 scans"), "{}", forced.error_msg);
    let saved = std::fs::read(reconstructor.path("saved.ply")).unwrap();
    assert!(std::fs::read(&path).unwrap() == saved, "the saved mesh is another one");
    tokio::time::timeout(ANSWER_DEADLINE, meshes.next()).await.unwrap().unwrap();
    let outcome = result(goal(&cloud_hash, 5, false)).await;
    let Outcome::Succeeded(good) = outcome else { panic!("{outcome:?}") };
    assert!(good.error_msg.is_empty(), "{}", good.error_msg);

    // Of three balls a mesh of one explains a third. Nothing is known of the scans.
    publish(&balls(3)).await;
    std::fs::remove_file(&path).unwrap();
    let three = tokio::time::timeout(ANSWER_DEADLINE, async {
        loop {
            let response = ask.call(&ReconstructRequest::default(), ANSWER_DEADLINE).await.unwrap();
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
    let response = ask.call(&request, ANSWER_DEADLINE).await.unwrap();
    assert!(response.success && !response.message.is_empty() && path.exists(), "{response:?}");
    reconstructor.stop().await;
}
