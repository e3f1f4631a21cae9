//! A running reconstructor, a node that calls it, and clouds for both.

use puffer_core::geometry::{Cloud, Vec3};
use puffer_ros::{NoParams, Node, RosArgs, Stop, domain};
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;
use tokio::task::JoinHandle;

/// Deadline of an answer, long enough for a loaded machine.
pub const ANSWER_DEADLINE: Duration = Duration::from_secs(120);

/// A reconstructor that runs in a DDS domain of its own.
pub struct Reconstructor {
    folder: TempDir,
    domain: u16,
    stop: Stop,
    running: JoinHandle<anyhow::Result<()>>,
}

impl Reconstructor {
    pub fn start() -> Reconstructor {
        let folder = tempfile::tempdir().unwrap();
        let domain = domain::find_free().unwrap();
        let stop = Stop::new();
        let args = arguments(folder.path(), domain);
        let running = tokio::spawn(mesh_reconstructor::run(args, stop.clone()));
        Reconstructor { folder, domain, stop, running }
    }

    /// A file in the folder that meshes are written into.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Another node in the same domain.
    pub async fn join(&self, name: &str) -> Node<NoParams> {
        let args = RosArgs::default().with_domain(self.domain);
        Node::start(name, args, Stop::new()).await.unwrap()
    }

    /// Stops the node, which must end without an error.
    pub async fn stop(self) {
        self.stop.stop();
        self.running.await.unwrap().unwrap();
    }
}

fn arguments(folder: &Path, domain: u16) -> RosArgs {
    let output = format!("mesh.output_folder:={}", folder.display());
    let words = ["--ros-args", "-p", &output].map(str::to_owned);
    RosArgs::parse(words).unwrap().with_domain(domain)
}

/// A ball of this radius (metres) about `center`, its points spread evenly (Fibonacci lattice).
pub fn ball(count: u32, radius: f64, center: Vec3) -> Cloud {
    let turn = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let mut cloud = Cloud::default();
    for k in 0..count {
        let z = 1.0 - 2.0 * (f64::from(k) + 0.5) / f64::from(count);
        let (sin, cos) = (turn * f64::from(k)).sin_cos();
        let normal = Vec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z);
        cloud.push(normal * radius + center, normal, 1e-4, 3);
    }
    cloud
}
