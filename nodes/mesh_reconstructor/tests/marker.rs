//! A node that subscribes to `model_marker` late still gets the model.

// The lints spare test functions only, not their helpers.
#![allow(clippy::unwrap_used)]

mod common;

use common::{ANSWER_DEADLINE, Reconstructor, ball};
use puffer_core::geometry::Vec3;
use puffer_core::mesh::io::write_cloud;
use puffer_msgs::srv::{Reconstruct, ReconstructRequest};
use puffer_msgs::visualization_msgs::msg::Marker;
use puffer_ros::QosProfile;

#[tokio::test(flavor = "multi_thread")]
async fn a_late_joiner_gets_three_coloured_corners_a_triangle() {
    let reconstructor = Reconstructor::start();
    let caller = reconstructor.join("caller").await;
    let client = caller.client::<Reconstruct>("mesh_reconstructor/reconstruct").unwrap();
    let input = reconstructor.path("ball.ply");
    write_cloud(&input, &ball(4000, 0.05, Vec3::zeros()), &[]).unwrap();
    // So coarse that all of it fits the socket buffers of a stock machine.
    let input = input.display().to_string();
    let request = ReconstructRequest { input, edge_length: 0.015, ..ReconstructRequest::default() };
    let response = client.call(&request, ANSWER_DEADLINE).await.unwrap();
    assert!(response.success, "{}", response.message);

    let late = reconstructor.join("late").await;
    let mut markers = late.subscribe::<Marker>("model_marker", QosProfile::LatchedSub).unwrap();
    let marker = markers.next_within(ANSWER_DEADLINE).await.unwrap();
    assert_eq!((marker.r#type, marker.header.frame_id.as_str()), (Marker::TRIANGLE_LIST, "object"));
    assert_eq!(marker.points.len(), 3 * response.triangles as usize);
    assert_eq!(marker.colors.len(), marker.points.len());
    assert!(marker.colors.iter().all(|c| c.a == 1.0 && c.r + c.g + c.b > 0.5));
    assert!(marker.points.iter().all(|p| (p.x * p.x + p.y * p.y + p.z * p.z).sqrt() < 0.06));
    reconstructor.stop().await;
}
