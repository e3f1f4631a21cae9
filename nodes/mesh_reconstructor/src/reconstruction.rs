//! From a cloud or an input file to a mesh file.

use crate::{Params, output_path};
use puffer_core::geometry::{Aabb, Cloud, Vec3};
use puffer_core::mesh::io::{Unit, write_mesh};
use puffer_core::mesh::{Mesh, genus, is_closed, is_oriented, is_two_manifold};
use puffer_core::pipeline::{self, PoseSource, mesh_comments};
use puffer_core::reconstruct::reconstruct;
use puffer_core::scan_files::ScanSource;
use puffer_core::verdict::{ModelVerdict, ScanCount};
use puffer_core::{Error, Progress};
use puffer_msgs::geometry_msgs::msg::Vector3;
use puffer_msgs::srv::{ReconstructRequest, ReconstructResponse};
use puffer_ros::conversions::region_from_message;
use puffer_ros::scans::{RegistrarParams, is_bag, scans_of_bag};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// The codes of `Reconstruct.srv`.
type Codes = ReconstructResponse;

/// A mesh with its verdict and the comments of its files.
pub(crate) struct Model {
    pub mesh: Mesh,
    pub verdict: ModelVerdict,
    /// The comment lines of its files.
    pub comments: Vec<String>,
}

/// A mesh and the response to the request. The mesh is written if the response is a success.
pub(crate) struct Reconstructed {
    pub model: Model,
    pub response: ReconstructResponse,
}

/// Makes the mesh that a request asks for and writes it. `cloud` is the current filtered cloud,
/// made of `scans` if they are known.
///
/// A mesh that is not trustworthy is written only if the request says so.
///
/// # Errors
/// The response that says why there is no mesh.
pub(crate) fn reconstruct_to_file(
    request: &ReconstructRequest,
    cloud: Option<&Cloud>,
    scans: Option<ScanCount>,
    params: &Params,
    progress: &Progress,
) -> Result<Reconstructed, Box<ReconstructResponse>> {
    let since = Instant::now();
    let path = output_path::resolve_output_path(&params.mesh.output_folder, &request.output_path)
        .map_err(|text| failure_response(Codes::BAD_OUTPUT, text))?;
    let mut params = params.clone();
    if request.edge_length > 0.0 {
        let value = serde_json::Value::from(f64::from(request.edge_length));
        params
            .reconstruct
            .set("edge_length", &value)
            .map_err(|error| failure_response(Codes::BAD_INPUT, error.to_string()))?;
    }
    let (mesh, cloud, verdict) = if request.input.is_empty() {
        let cloud = cloud.ok_or_else(|| {
            failure_response(
                Codes::NO_CLOUD,
                "no filtered cloud came yet: call cloud_filter's filter".into(),
            )
        })?;
        let mesh = reconstruct(cloud, &params.reconstruct, progress).map_err(error_response)?;
        let verdict = ModelVerdict::new(scans, cloud, &mesh);
        (mesh, cloud.clone(), verdict)
    } else {
        reconstruct_from_file(Path::new(&request.input), &params, progress)
            .map_err(error_response)?
    };
    let comments = mesh_comments(&cloud, params.mesh.seed as u64).to_vec();
    let model = Model { mesh, verdict, comments };
    let mut response = describe_mesh(&model);
    match (model.verdict.distrust_reason(), request.force) {
        (Some(reason), false) => {
            response.error_code = Codes::NOT_TRUSTWORTHY;
            response.message = format!("{reason}; {FORCE_HINT}");
        }
        (distrust, _) => {
            write_mesh(&path, &model.mesh, &model.comments).map_err(error_response)?;
            response.success = true;
            response.mesh_path = path.display().to_string();
            response.message = distrust.unwrap_or_default();
        }
    }
    response.seconds = since.elapsed().as_secs_f32();
    Ok(Reconstructed { model, response })
}

/// What a user can do who wants a mesh that is not trustworthy.
pub(crate) const FORCE_HINT: &str = "the mesh is not written: call mesh_reconstructor's \
     save_mesh with force to have it all the same";

/// The points of a cloud within the region of interest; all of them if its edges are 0.
///
/// # Errors
/// The response that says what is wrong with the region.
pub(crate) fn crop_to_region(
    cloud: Arc<Cloud>,
    roi: &Vector3,
) -> Result<Arc<Cloud>, Box<ReconstructResponse>> {
    let everywhere =
        Aabb { min: Vec3::repeat(f64::NEG_INFINITY), max: Vec3::repeat(f64::INFINITY) };
    let region = region_from_message(roi, &everywhere)
        .map_err(|text| failure_response(Codes::BAD_INPUT, text))?;
    if region == everywhere {
        return Ok(cloud);
    }
    let inside = (0..cloud.len()).filter(|&i| region.contains(&cloud.points[i]));
    Ok(Arc::new(cloud.select(&inside.collect::<Vec<_>>())))
}

/// The mesh, the cloud and the verdict of all stages for a scan folder, a bag or a cloud file.
fn reconstruct_from_file(
    input: &Path,
    params: &Params,
    progress: &Progress,
) -> puffer_core::Result<(Mesh, Cloud, ModelVerdict)> {
    let registrar_params =
        RegistrarParams { scan: params.scan.clone(), register: params.register.clone() };
    let input = if is_bag(input) {
        let scans =
            scans_of_bag(input, &registrar_params, progress).map_err(|error| {
                match error.downcast::<Error>() {
                    Ok(error) => error,
                    Err(other) => Error::Input(format!("{other:#}")),
                }
            })?;
        pipeline::PipelineInput::Scans(ScanSource::from_set(scans))
    } else {
        pipeline::PipelineInput::open(input, Unit::Metre)?
    };
    let stages = pipeline::PipelineParams {
        register: params.register.clone(),
        filter: params.filter.clone(),
        reconstruct: params.reconstruct.clone(),
    };
    let outcome = pipeline::run(&input, PoseSource::Robot, &stages, progress)?;
    Ok((outcome.mesh, outcome.cloud, outcome.verdict))
}

/// The response for a mesh, except for whether it is written.
fn describe_mesh(model: &Model) -> ReconstructResponse {
    let Model { mesh, verdict, .. } = model;
    let measured: Vec<f64> = mesh.sigma.iter().copied().filter(|s| s.is_finite()).collect();
    let unobserved = mesh.observed.iter().filter(|o| !**o).count();
    ReconstructResponse {
        vertices: mesh.vertices.len() as u32,
        triangles: mesh.triangles.len() as u32,
        genus: genus(mesh).and_then(|g| i32::try_from(g).ok()).unwrap_or(-1),
        closed: is_closed(mesh) && is_two_manifold(mesh) && is_oriented(mesh),
        mean_sigma: (measured.iter().sum::<f64>() / measured.len().max(1) as f64) as f32,
        unobserved_share: unobserved as f32 / mesh.vertices.len().max(1) as f32,
        scans: verdict.scans.map_or(0, |scans| scans.all() as u32),
        accepted: verdict.scans.map_or(0, |scans| scans.accepted() as u32),
        share_of_scans_accepted: share_or_nan(verdict.scans.map(|scans| scans.share())),
        share_of_cells_explained: share_or_nan(verdict.cells_explained),
        ..ReconstructResponse::default()
    }
}

/// A share as messages hold it: NaN if it is unknown.
pub(crate) fn share_or_nan(share: Option<f64>) -> f32 {
    share.map_or(f32::NAN, |share| share as f32)
}

pub(crate) fn failure_response(error_code: u16, message: String) -> Box<ReconstructResponse> {
    Box::new(ReconstructResponse {
        error_code,
        message,
        share_of_scans_accepted: f32::NAN,
        share_of_cells_explained: f32::NAN,
        ..ReconstructResponse::default()
    })
}

fn error_response(error: Error) -> Box<ReconstructResponse> {
    let code = match &error {
        Error::Cancelled => Codes::CANCELLED,
        Error::Io { action: "write" | "create", .. } => Codes::BAD_OUTPUT,
        Error::Io { .. } | Error::Format { .. } | Error::Input(_) | Error::Parameter { .. } => {
            Codes::BAD_INPUT
        }
    };
    failure_response(code, error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measurements_beyond_the_region_are_left_out() {
        let mut cloud = Cloud::default();
        for (x, z) in [(0.0, 0.1), (0.09, 0.1), (0.11, 0.1), (0.0, 0.4), (0.0, -0.02)] {
            cloud.push(Vec3::new(x, 0.0, z), Vec3::z(), 1e-4, 1);
        }
        let cloud = Arc::new(cloud);
        let all = crop_to_region(Arc::clone(&cloud), &Vector3::default()).unwrap();
        assert!(Arc::ptr_eq(&all, &cloud));
        let some = crop_to_region(Arc::clone(&cloud), &Vector3 { x: 0.2, y: 0.0, z: 0.3 }).unwrap();
        assert_eq!(some.points, [cloud.points[0], cloud.points[1], cloud.points[4]]);
        let wrong = crop_to_region(cloud, &Vector3 { x: -1.0, y: 0.0, z: 0.0 }).err().unwrap();
        assert_eq!(wrong.error_code, Codes::BAD_INPUT);
    }
}
