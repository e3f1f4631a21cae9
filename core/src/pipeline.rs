//! The stages from scans to a mesh in a row, without ROS: prepare, register, filter, reconstruct.
//!
//! ```
//! use puffer_core::Progress;
//! use puffer_core::geometry::{Cloud, Vec3};
//! use puffer_core::pipeline::{PipelineInput, PipelineParams, PoseSource, run};
//!
//! // Points spread evenly over a ball of 5 cm radius (Fibonacci's lattice).
//! let mut cloud = Cloud::default();
//! for i in 0..2000 {
//!     let (z, turn) = (1.0 - (f64::from(i) + 0.5) / 1000.0, 2.399_963 * f64::from(i));
//!     let radius = (1.0 - z * z).sqrt();
//!     let normal = Vec3::new(radius * turn.cos(), radius * turn.sin(), z);
//!     cloud.push(normal * 0.05, normal, 1e-4, 1);
//! }
//! let input = PipelineInput::Cloud(cloud);
//! let params = PipelineParams::default();
//! let outcome = run(&input, PoseSource::Exact, &params, &Progress::silent())?;
//! assert_eq!(outcome.verdict.distrust_reason(), None);
//! # Ok::<(), puffer_core::Error>(())
//! ```

use crate::filter::{FilterParams, Filtered, filter};
use crate::geometry::{Cloud, Pose};
use crate::mesh::Mesh;
use crate::mesh::io::{Unit, read_cloud_with_unit};
use crate::reconstruct::{ReconstructParams, reconstruct};
use crate::register::{RegisterParams, Registration, register};
use crate::scan::{PoseSigma, PreparedScan, Support};
use crate::scan_files::ScanSource;
use crate::verdict::{ModelVerdict, ScanCount};
use crate::{Error, Progress, Result};
use sha2::{Digest, Sha256};
use std::path::Path;

crate::param_groups! {
    /// Parameters of all stages.
    pub struct PipelineParams {
        /// Parameters of the registration.
        register: RegisterParams,
        /// Parameters of the filter.
        filter: FilterParams,
        /// Parameters of the reconstruction.
        reconstruct: ReconstructParams,
    }
}

/// What a mesh can be made of.
pub enum PipelineInput {
    /// Scans with the robot's poses.
    Scans(ScanSource),
    /// One cloud of registered points with normals.
    Cloud(Cloud),
}

impl PipelineInput {
    /// Opens a scan folder, a Stanford `.conf`, or a single PLY with normals.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`] or [`Error::Input`] with what is wrong and what to do.
    pub fn open(path: &Path, unit: Unit) -> Result<PipelineInput> {
        std::fs::metadata(path).map_err(|error| Error::io("read", path, error))?;
        let is_ply = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("ply"));
        if is_ply && path.is_file() {
            return Ok(PipelineInput::Cloud(read_cloud_with_unit(path, unit)?));
        }
        Ok(PipelineInput::Scans(ScanSource::open(path, unit)?))
    }
}

/// Where the poses of the input come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PoseSource {
    /// From a robot, with errors: the scans are registered.
    Robot,
    /// From an exact measurement: the scans are not registered.
    Exact,
}

/// Prepared scans: oriented points, names and poses, an element a scan.
pub struct PreparedInput {
    /// Oriented points of each scan, sensor frame.
    pub scans: Vec<PreparedScan>,
    /// Name of each scan.
    pub names: Vec<String>,
    /// Pose `object_from_sensor` of each scan as the robot reports it.
    pub robot_poses: Vec<Pose>,
    /// Standard deviation of those poses, if known.
    pub pose_sigma: Option<PoseSigma>,
}

/// Reads all scans and estimates their normals.
///
/// # Errors
/// As [`ScanSource::view`], and [`Error::Input`] naming the view that cannot be used;
/// [`Error::Cancelled`].
pub fn prepare_scans(files: &ScanSource, progress: &Progress) -> Result<PreparedInput> {
    let mut prepared = PreparedInput {
        scans: Vec::new(),
        names: Vec::new(),
        robot_poses: Vec::new(),
        pose_sigma: files.pose_sigma,
    };
    for index in 0..files.len() {
        progress.report("read", index as f64 / files.len() as f64)?;
        let view = files.view(index)?;
        let scan = PreparedScan::new(&view.scan)
            .map_err(|error| Error::input(format!("view {}: {error}", view.name)))?;
        prepared.scans.push(scan);
        prepared.names.push(view.name);
        prepared.robot_poses.push(view.object_from_sensor);
    }
    progress.report("read", 1.0)?;
    Ok(prepared)
}

/// Registers the scans, unless their poses are exact.
///
/// # Errors
/// As [`register`].
pub fn register_scans(
    prepared: &PreparedInput,
    poses: PoseSource,
    params: &RegisterParams,
    progress: &Progress,
) -> Result<Registration> {
    match poses {
        PoseSource::Robot => {
            register(&prepared.scans, &prepared.robot_poses, prepared.pose_sigma, params, progress)
        }
        PoseSource::Exact => Ok(Registration::exact(&prepared.scans, &prepared.robot_poses)),
    }
}

/// Combines the accepted scans into one cloud.
///
/// # Errors
/// As [`filter`].
pub fn filter_scans(
    prepared: &PreparedInput,
    registration: &Registration,
    params: &FilterParams,
    progress: &Progress,
) -> Result<Filtered> {
    let scans: Vec<(&PreparedScan, Pose)> = (0..prepared.scans.len())
        .filter(|&i| registration.verdicts[i].is_accepted())
        .map(|i| (&prepared.scans[i], registration.poses[i]))
        .collect();
    filter(&scans, registration.residual, params, progress)
}

/// SHA-256 of a cloud's points, normals and standard deviations, in hexadecimal.
pub fn cloud_hash(cloud: &Cloud) -> String {
    let mut hash = Sha256::new();
    for value in cloud.points.iter().chain(&cloud.normals).flat_map(|v| v.iter()) {
        hash.update(value.to_le_bytes());
    }
    for sigma in &cloud.sigma {
        hash.update(sigma.to_le_bytes());
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The comment lines of a mesh file: program, seed, and the hash of the cloud that the mesh was
/// made of.
pub fn mesh_comments(cloud: &Cloud, seed: u64) -> [String; 3] {
    [
        format!("puffer {}", env!("CARGO_PKG_VERSION")),
        format!("seed {seed}"),
        format!("cloud sha256 {}", cloud_hash(cloud)),
    ]
}

/// The results of all stages.
pub struct PipelineOutcome {
    /// The mesh.
    pub mesh: Mesh,
    /// The cloud that it was made of.
    pub cloud: Cloud,
    /// Measurements that went into the cloud.
    pub measurements: usize,
    /// The registration; `None` for a single cloud.
    pub registration: Option<Registration>,
    /// Names of the views, empty for a single cloud.
    pub names: Vec<String>,
    /// Whether the mesh is to be trusted.
    pub verdict: ModelVerdict,
}

/// Makes a mesh of the input by all stages. The object's support that the scans name counts unless
/// `params` name another one.
///
/// # Errors
/// Those of the stages.
pub fn run(
    input: &PipelineInput,
    poses: PoseSource,
    params: &PipelineParams,
    progress: &Progress,
) -> Result<PipelineOutcome> {
    let files = match input {
        PipelineInput::Cloud(cloud) => {
            let mesh = reconstruct(cloud, &params.reconstruct, progress)?;
            let verdict = ModelVerdict::new(None, cloud, &mesh);
            let (cloud, measurements) = (cloud.clone(), cloud.len());
            return Ok(PipelineOutcome {
                mesh,
                cloud,
                measurements,
                registration: None,
                names: Vec::new(),
                verdict,
            });
        }
        PipelineInput::Scans(files) => files,
    };
    let prepared = prepare_scans(files, progress)?;
    let registration = register_scans(&prepared, poses, &params.register, progress)?;
    let filtered = filter_scans(&prepared, &registration, &params.filter, progress)?;
    let mut reconstruct_params = params.reconstruct.clone();
    if reconstruct_params.support == Support::None {
        reconstruct_params.support = files.support;
    }
    let mesh = reconstruct(&filtered.cloud, &reconstruct_params, progress)?;
    let scans = ScanCount::from_verdicts(&registration.verdicts);
    Ok(PipelineOutcome {
        verdict: ModelVerdict::new(scans, &filtered.cloud, &mesh),
        mesh,
        cloud: filtered.cloud,
        measurements: filtered.measurements,
        registration: Some(registration),
        names: prepared.names,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vec3;

    fn two_points() -> Cloud {
        let mut cloud = Cloud::default();
        cloud.push(Vec3::x(), Vec3::z(), 1e-4, 1);
        cloud.push(Vec3::y(), Vec3::z(), 1e-4, 1);
        cloud
    }

    #[test]
    fn the_hash_covers_points_normals_and_sigma_but_not_support() {
        let cloud = two_points();
        let hash = cloud_hash(&cloud);
        assert_eq!(hash.len(), 64);
        let mut others = vec![cloud.clone(); 3];
        others[0].points[0].x += 1e-12;
        others[1].normals[1] = -Vec3::z();
        others[2].sigma[0] = 2e-4;
        assert!(others.iter().all(|other| cloud_hash(other) != hash));
        let mut supported = cloud;
        supported.support[0] = 9;
        assert_eq!(cloud_hash(&supported), hash);
        // The SHA-256 of nothing.
        assert!(cloud_hash(&Cloud::default()).starts_with("e3b0c44298fc1c14"));
    }

    #[test]
    fn comments_name_program_seed_and_cloud() {
        let cloud = two_points();
        let [program, seed, hash] = mesh_comments(&cloud, 7);
        assert!(program.starts_with("puffer "), "{program}");
        assert_eq!(seed, "seed 7");
        assert_eq!(hash, format!("cloud sha256 {}", cloud_hash(&cloud)));
    }

    #[test]
    fn a_path_that_is_not_there_is_named() {
        let error = PipelineInput::open(Path::new("no/such/folder"), Unit::Metre).err().unwrap();
        assert!(matches!(&error, Error::Io { action: "read", .. }), "{error}");
        assert!(error.to_string().contains("no/such/folder"), "{error}");
    }
}
