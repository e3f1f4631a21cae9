//! The services and the action.

use crate::marker::mesh_marker;
use crate::work::{HOW_TO_FORCE, Made, Model, failure, make, share_message, within_region};
use crate::{Desk, Params, paths};
use anyhow::Result;
use puffer_core::Progress;
use puffer_core::mesh::io::write_mesh;
use puffer_core::verdict::ScanCount;
use puffer_msgs::action::{
    ReconstructMesh, ReconstructMeshFeedback, ReconstructMeshGoal, ReconstructMeshResult,
};
use puffer_msgs::builtin_interfaces::msg::Time;
use puffer_msgs::geometry_msgs::msg::Vector3;
use puffer_msgs::msg::ModelMesh;
use puffer_msgs::srv::{
    Reconstruct, ReconstructRequest, ReconstructResponse, SaveMesh, SaveMeshRequest,
    SaveMeshResponse,
};
use puffer_msgs::std_msgs::msg::Header;
use puffer_msgs::visualization_msgs::msg::Marker;
use puffer_shell::bulk::{BulkPublisher, Mode, WholePublisher};
use puffer_shell::convert::mesh_message;
use puffer_shell::{Goal, Node, Outcome};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::Mutex;

/// How long a goal waits for the cloud that it names.
const CLOUD_DEADLINE: Duration = Duration::from_secs(30);

/// How long it waits for the readers of the mesh: whoever hears that it is there may end this node.
const FLUSH_DEADLINE: Duration = Duration::from_secs(5);

/// Everything that a request needs.
struct Counter {
    node: Node<Params>,
    desk: Arc<Mutex<Desk>>,
    meshes: BulkPublisher,
    markers: WholePublisher<Marker>,
    /// One reconstruction at a time: each takes all cores.
    turn: Mutex<()>,
}

/// Which measurements a mesh is made of; none of it counts for inputs from files.
#[derive(Default)]
struct Wanted {
    /// The cloud's; empty: any.
    cloud_hash: String,
    /// Edges of the region of interest, as in `ReconstructMesh.action`.
    roi: Vector3,
    /// Of how many scans the cloud was made, if that is known.
    scans: Option<ScanCount>,
}

pub(crate) fn all(node: &Node<Params>, desk: &Arc<Mutex<Desk>>) -> Result<()> {
    let counter = Arc::new(Counter {
        node: node.clone(),
        desk: Arc::clone(desk),
        meshes: node.bulk_publisher_for_all::<ModelMesh>("model_mesh", Mode::Latched)?,
        markers: node.whole_publisher("model_marker")?,
        turn: Mutex::new(()),
    });
    let at = Arc::clone(&counter);
    node.serve::<Reconstruct, _, _>("~/reconstruct", move |request: ReconstructRequest| {
        let at = Arc::clone(&at);
        async move { at.reconstruct(&request, &Wanted::default(), &Progress::silent()).await }
    })?;
    let at = Arc::clone(&counter);
    node.action_server::<ReconstructMesh, _, _, _>(
        "~/reconstruct_action",
        |_: &ReconstructMeshGoal| Ok(()),
        move |goal: Goal<ReconstructMesh>| {
            let at = Arc::clone(&at);
            async move { at.act(goal).await }
        },
    )?;
    node.serve::<SaveMesh, _, _>("~/save_mesh", move |request: SaveMeshRequest| {
        let at = Arc::clone(&counter);
        async move { at.save(&request).await }
    })
}

impl Counter {
    async fn reconstruct(
        &self,
        request: &ReconstructRequest,
        wanted: &Wanted,
        progress: &Progress,
    ) -> ReconstructResponse {
        let _turn = self.turn.lock().await;
        if let Err(response) = self.wait_for_cloud(&wanted.cloud_hash).await {
            return *response;
        }
        let cloud = self.desk.lock().await.cloud.as_ref().map(|(cloud, _)| Arc::clone(cloud));
        let params = self.node.params();
        let made = tokio::task::block_in_place(|| {
            let cloud = cloud.map(|cloud| within_region(cloud, &wanted.roi)).transpose()?;
            make(request, cloud.as_deref(), wanted.scans, &params, progress)
        });
        let Made { model, response } = match made {
            Ok(made) => made,
            Err(response) => {
                if response.error_code == ReconstructResponse::CANCELLED {
                    tracing::info!("no mesh: {}", response.message);
                } else {
                    tracing::error!("no mesh: {}", response.message);
                }
                return *response;
            }
        };
        if response.success {
            self.publish(&model, &params.scan.object_frame).await;
            tracing::info!(
                "{} vertices, genus {}, closed {}, {:.1} s, {}: {}",
                response.vertices,
                response.genus,
                response.closed,
                response.seconds,
                model.verdict.summary(),
                response.mesh_path
            );
        } else {
            tracing::error!("no mesh: {}", response.message);
        }
        self.desk.lock().await.model = Some(Arc::new(model));
        response
    }

    /// Publishes a mesh and its marker.
    async fn publish(&self, model: &Model, frame: &str) {
        let (sec, nanosec) = self.node.now().parts();
        let header = Header { stamp: Time { sec, nanosec }, frame_id: frame.to_owned() };
        let marker = mesh_marker(&model.mesh, header.clone(), self.markers.most_bytes());
        let shown = marker.points.len() / 3;
        let triangles = model.mesh.triangles.len();
        if shown < triangles {
            tracing::debug!("model_marker shows {shown} triangles of {triangles}");
        }
        if let Err(error) = self.markers.publish(&marker) {
            tracing::warn!("{error}");
        }
        let message = mesh_message(&model.mesh, header);
        if let Err(error) = self.meshes.publish_message(&message).await {
            tracing::error!("the mesh is written, but not published: {error}");
        } else if let Err(error) = self.meshes.flush(FLUSH_DEADLINE).await {
            tracing::warn!("{error}");
        }
    }

    /// Waits for the cloud with the hash; any if it is empty.
    async fn wait_for_cloud(
        &self,
        hash: &str,
    ) -> std::result::Result<(), Box<ReconstructResponse>> {
        let since = Instant::now();
        loop {
            let there = self.desk.lock().await.cloud.as_ref().is_some_and(|(_, h)| h == hash);
            if there || hash.is_empty() {
                return Ok(());
            }
            if since.elapsed() > CLOUD_DEADLINE {
                let text = format!(
                    "the filtered cloud {} did not come within {} s",
                    &hash[..hash.len().min(12)],
                    CLOUD_DEADLINE.as_secs()
                );
                return Err(failure(ReconstructResponse::NO_CLOUD, text));
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }

    async fn act(&self, goal: Goal<ReconstructMesh>) -> Outcome<ReconstructMeshResult> {
        let report = goal.clone();
        let progress = Progress::to(move |stage, fraction| {
            let stage = stage.to_owned();
            report.feedback(&ReconstructMeshFeedback { stage, fraction: fraction as f32 });
        });
        let watch = tokio::spawn({
            let (goal, progress) = (goal.clone(), progress.clone());
            async move {
                goal.cancelled().await;
                progress.cancel();
            }
        });
        let asked = goal.request();
        let request = ReconstructRequest {
            input: asked.input.clone(),
            output_path: asked.output_path.clone(),
            edge_length: asked.edge_length,
            force: asked.force,
        };
        let scans = ScanCount::new(asked.scans as usize, asked.accepted as usize);
        let wanted = Wanted { cloud_hash: asked.cloud_hash.clone(), roi: asked.roi, scans };
        let response = self.reconstruct(&request, &wanted, &progress).await;
        watch.abort();
        let (success, code) = (response.success, response.error_code);
        let result = as_result(response);
        match code {
            _ if success => Outcome::Succeeded(result),
            ReconstructResponse::CANCELLED => Outcome::Canceled(result),
            _ => Outcome::Aborted(result),
        }
    }

    async fn save(&self, request: &SaveMeshRequest) -> SaveMeshResponse {
        let model = self.desk.lock().await.model.clone();
        let verdict = model.as_ref().map(|model| model.verdict).unwrap_or_default();
        let saved = self.try_to_save(request, model.as_deref());
        let (error_code, message) = match saved {
            Ok(message) => (SaveMeshResponse::NONE, message),
            Err(fault) => fault,
        };
        SaveMeshResponse {
            success: error_code == SaveMeshResponse::NONE,
            error_code,
            message,
            share_of_scans_accepted: share_message(verdict.scans.map(|scans| scans.share())),
            share_of_cells_explained: share_message(verdict.cells_explained),
        }
    }

    /// The path of the file, or what kept it from being written.
    fn try_to_save(
        &self,
        request: &SaveMeshRequest,
        model: Option<&Model>,
    ) -> std::result::Result<String, (u16, String)> {
        let failed = |text: String| (SaveMeshResponse::FAILED, text);
        let folder = self.node.params().mesh.output_folder;
        let path = paths::within(&folder, &request.path).map_err(failed)?;
        let model =
            model.ok_or_else(|| failed("there is no mesh yet: call reconstruct first".into()))?;
        if let Some(reason) = model.verdict.distrust().filter(|_| !request.force) {
            let text = format!("{reason}; {HOW_TO_FORCE}");
            return Err((SaveMeshResponse::NOT_TRUSTWORTHY, text));
        }
        write_mesh(&path, &model.mesh, &model.comments)
            .map_err(|error| failed(error.to_string()))?;
        Ok(path.display().to_string())
    }
}

fn as_result(response: ReconstructResponse) -> ReconstructMeshResult {
    ReconstructMeshResult {
        success: response.success,
        error_code: response.error_code,
        error_msg: response.message,
        mesh_path: response.mesh_path,
        vertices: response.vertices,
        triangles: response.triangles,
        genus: response.genus,
        closed: response.closed,
        mean_sigma: response.mean_sigma,
        unobserved_share: response.unobserved_share,
        seconds: response.seconds,
        scans: response.scans,
        accepted: response.accepted,
        share_of_scans_accepted: response.share_of_scans_accepted,
        share_of_cells_explained: response.share_of_cells_explained,
    }
}
