//! Who comes late to `model_marker` gets the model all the same.

// The lints spare test functions only, not their helpers.
#![allow(clippy::unwrap_used)]

use puffer_core::geometry::{Cloud, Vec3};
use puffer_core::mesh::io::write_cloud;
use puffer_msgs::srv::{Reconstruct, ReconstructRequest};
use puffer_msgs::visualization_msgs::msg::Marker;
use puffer_shell::{NoParams, Node, Profile, RosArgs, Stop, domain};
use std::path::Path;
use std::time::Duration;

/// Long enough for a loaded machine.
const SOON: Duration = Duration::from_secs(120);

/// A ball of 50 mm, its points spread evenly (Fibonacci's lattice).
fn ball() -> Cloud {
    let count = 4000;
    let turn = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let mut cloud = Cloud::default();
    for k in 0..count {
        let z = 1.0 - 2.0 * (f64::from(k) + 0.5) / f64::from(count);
        let (sin, cos) = (turn * f64::from(k)).sin_cos();
        let normal = Vec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z);
        cloud.push(normal * 0.05, normal, 1e-4, 3);
    }
    cloud
}

fn arguments(folder: &Path, domain: u16) -> RosArgs {
    let output = format!("mesh.output_folder:={}", folder.display());
    let words = ["--ros-args", "-p", &output].map(str::to_owned);
    RosArgs::parse(words).unwrap().with_domain(domain)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_late_joiner_gets_three_coloured_corners_a_triangle() {
    let folder = tempfile::tempdir().unwrap();
    let domain = domain::free().unwrap();
    let stop = Stop::new();
    let running =
        tokio::spawn(mesh_reconstructor::run(arguments(folder.path(), domain), stop.clone()));
    let args = RosArgs::default().with_domain(domain);
    let caller = Node::<NoParams>::start("caller", args.clone(), Stop::new()).await.unwrap();
    let client = caller.client::<Reconstruct>("mesh_reconstructor/reconstruct").unwrap();
    let input = folder.path().join("ball.ply");
    write_cloud(&input, &ball(), &[]).unwrap();
    // So coarse that all of it fits the socket buffers of a stock machine.
    let input = input.display().to_string();
    let request = ReconstructRequest { input, edge_length: 0.015, ..ReconstructRequest::default() };
    let response = client.call(&request, SOON).await.unwrap();
    assert!(response.success, "{}", response.message);

    let late = Node::<NoParams>::start("late", args, Stop::new()).await.unwrap();
    let mut markers = late.subscribe::<Marker>("model_marker", Profile::LatchedSub).unwrap();
    let marker = markers.next_within(SOON).await.unwrap();
    assert_eq!((marker.r#type, marker.header.frame_id.as_str()), (Marker::TRIANGLE_LIST, "object"));
    assert_eq!(marker.points.len(), 3 * response.triangles as usize);
    assert_eq!(marker.colors.len(), marker.points.len());
    assert!(marker.colors.iter().all(|c| c.a == 1.0 && c.r + c.g + c.b > 0.5));
    assert!(marker.points.iter().all(|p| (p.x * p.x + p.y * p.y + p.z * p.z).sqrt() < 0.06));
    stop.stop();
    running.await.unwrap().unwrap();
}
