//! The services and the action of the node.

use crate::marker::mesh_marker;
use crate::reconstruction::{
    FORCE_HINT, Model, Reconstructed, crop_to_region, failure_response, reconstruct_to_file,
    share_or_nan,
};
use crate::{Params, ReconstructorState, output_path};
use anyhow::Result;
use puffer_core::Progress;
use puffer_core::mesh::io::write_mesh;
use puffer_core::verdict::ScanCount;
use puffer_msgs::action::{
    ReconstructMesh, ReconstructMeshFeedback, ReconstructMeshGoal, ReconstructMeshResult,
};
use puffer_msgs::geometry_msgs::msg::Vector3;
use puffer_msgs::msg::ModelMesh;
use puffer_msgs::srv::{
    Reconstruct, ReconstructRequest, ReconstructResponse, SaveMesh, SaveMeshRequest,
    SaveMeshResponse,
};
use puffer_msgs::std_msgs::msg::Header;
use puffer_msgs::visualization_msgs::msg::Marker;
use puffer_ros::conversions::mesh_message;
use puffer_ros::large_data::{LargeDataPublisher, Retention, WholeMessagePublisher};
use puffer_ros::{Goal, Node, Outcome, Shared};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Mutex;

/// How long a goal waits for the cloud that it names.
const CLOUD_DEADLINE: Duration = Duration::from_secs(30);

/// How long it waits until all readers have the mesh: whoever is told that it is there may stop
/// this node.
const FLUSH_DEADLINE: Duration = Duration::from_secs(5);

/// Carries out the requests.
struct ReconstructionServer {
    node: Node<Params>,
    state: Shared<ReconstructorState>,
    meshes: LargeDataPublisher,
    markers: WholeMessagePublisher<Marker>,
    /// One reconstruction at a time: each takes all cores.
    turn: Mutex<()>,
}

/// Which cloud, and which part of it, a mesh is made of. It does not apply to inputs from files.
#[derive(Default)]
struct CloudSelection {
    /// Hash of the cloud; empty for the newest one.
    cloud_hash: String,
    /// Edges of the region of interest, as in `ReconstructMesh.action`.
    roi: Vector3,
    /// The scans that the cloud was made of, if they are known.
    scans: Option<ScanCount>,
}

/// Starts the services and the action.
///
/// # Errors
/// No network.
pub(crate) fn serve(node: &Node<Params>, state: &Shared<ReconstructorState>) -> Result<()> {
    let server = Arc::new(ReconstructionServer {
        node: node.clone(),
        state: state.clone(),
        meshes: node
            .large_data_publisher_for_any_reader::<ModelMesh>("model_mesh", Retention::Latched)?,
        markers: node.whole_message_publisher("model_marker")?,
        turn: Mutex::new(()),
    });
    let at = Arc::clone(&server);
    node.serve::<Reconstruct, _, _>("~/reconstruct", move |request: ReconstructRequest| {
        let at = Arc::clone(&at);
        async move { at.reconstruct(&request, &CloudSelection::default(), &Progress::silent()).await }
    })?;
    let at = Arc::clone(&server);
    node.action_server::<ReconstructMesh, _, _, _>(
        "~/reconstruct_action",
        |_: &ReconstructMeshGoal| Ok(()),
        move |goal: Goal<ReconstructMesh>| {
            let at = Arc::clone(&at);
            async move { at.reconstruct_for_goal(goal).await }
        },
    )?;
    node.serve::<SaveMesh, _, _>("~/save_mesh", move |request: SaveMeshRequest| {
        let at = Arc::clone(&server);
        async move { at.save_mesh(&request).await }
    })
}

impl ReconstructionServer {
    /// Makes, writes and publishes a mesh.
    async fn reconstruct(
        &self,
        request: &ReconstructRequest,
        selection: &CloudSelection,
        progress: &Progress,
    ) -> ReconstructResponse {
        let _turn = self.turn.lock().await;
        if let Err(response) = self.wait_for_cloud(&selection.cloud_hash).await {
            return *response;
        }
        let cloud = self.state.lock().await.cloud.as_ref().map(|(cloud, _)| Arc::clone(cloud));
        let params = self.node.params();
        let reconstructed = tokio::task::block_in_place(|| {
            let cloud = cloud.map(|cloud| crop_to_region(cloud, &selection.roi)).transpose()?;
            reconstruct_to_file(request, cloud.as_deref(), selection.scans, &params, progress)
        });
        let Reconstructed { model, response } = match reconstructed {
            Ok(reconstructed) => reconstructed,
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
        self.state.lock().await.model = Some(Arc::new(model));
        response
    }

    /// Publishes a mesh and its marker.
    async fn publish(&self, model: &Model, frame: &str) {
        let header = Header { stamp: self.node.now().into(), frame_id: frame.to_owned() };
        let marker = mesh_marker(&model.mesh, header.clone(), self.markers.max_bytes());
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
        let waited = self.state.wait_until(CLOUD_DEADLINE, |state| {
            let there = state.cloud.as_ref().is_some_and(|(_, newest)| newest == hash);
            if there || hash.is_empty() { Ok(()) } else { Err(&hash[..hash.len().min(12)]) }
        });
        waited.await.map_err(|missing| {
            let seconds = CLOUD_DEADLINE.as_secs();
            let text = format!("the filtered cloud {missing} did not come within {seconds} s");
            failure_response(ReconstructResponse::NO_CLOUD, text)
        })
    }

    /// Carries out a goal of the action.
    async fn reconstruct_for_goal(
        &self,
        goal: Goal<ReconstructMesh>,
    ) -> Outcome<ReconstructMeshResult> {
        let progress = goal.progress(|stage, fraction| ReconstructMeshFeedback {
            stage: stage.to_owned(),
            fraction: fraction as f32,
        });
        let asked = goal.request();
        let request = ReconstructRequest {
            input: asked.input.clone(),
            output_path: asked.output_path.clone(),
            edge_length: asked.edge_length,
            force: asked.force,
        };
        let scans = ScanCount::new(asked.scans as usize, asked.accepted as usize);
        let selection =
            CloudSelection { cloud_hash: asked.cloud_hash.clone(), roi: asked.roi, scans };
        let response = self.reconstruct(&request, &selection, &progress).await;
        let (success, code) = (response.success, response.error_code);
        let result = goal_result(response);
        match code {
            _ if success => Outcome::Succeeded(result),
            ReconstructResponse::CANCELLED => Outcome::Canceled(result),
            _ => Outcome::Aborted(result),
        }
    }

    /// Writes the newest mesh to a file.
    async fn save_mesh(&self, request: &SaveMeshRequest) -> SaveMeshResponse {
        let model = self.state.lock().await.model.clone();
        let verdict = model.as_ref().map(|model| model.verdict).unwrap_or_default();
        let saved = self.write_saved_mesh(request, model.as_deref());
        let (error_code, message) = match saved {
            Ok(message) => (SaveMeshResponse::NONE, message),
            Err(fault) => fault,
        };
        SaveMeshResponse {
            success: error_code == SaveMeshResponse::NONE,
            error_code,
            message,
            share_of_scans_accepted: share_or_nan(verdict.scans.map(|scans| scans.share())),
            share_of_cells_explained: share_or_nan(verdict.cells_explained),
        }
    }

    /// The path of the file; else the error code and text that say why it was not written.
    fn write_saved_mesh(
        &self,
        request: &SaveMeshRequest,
        model: Option<&Model>,
    ) -> std::result::Result<String, (u16, String)> {
        let folder = self.node.params().mesh.output_folder;
        let path =
            output_path::resolve_output_path(&folder, &request.path).map_err(save_failure)?;
        let model = model
            .ok_or_else(|| save_failure("there is no mesh yet: call reconstruct first".into()))?;
        if let Some(reason) = model.verdict.distrust_reason().filter(|_| !request.force) {
            let text = format!("{reason}; {FORCE_HINT}");
            return Err((SaveMeshResponse::NOT_TRUSTWORTHY, text));
        }
        write_mesh(&path, &model.mesh, &model.comments)
            .map_err(|error| save_failure(error.to_string()))?;
        Ok(path.display().to_string())
    }
}

fn save_failure(text: String) -> (u16, String) {
    (SaveMeshResponse::FAILED, text)
}

/// The response of the service as the result of the action.
fn goal_result(response: ReconstructResponse) -> ReconstructMeshResult {
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
