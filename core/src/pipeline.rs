//! The whole way from scans to a mesh, without ROS: prepare, register, filter, reconstruct.

use crate::filter::{FilterParams, Filtered, filter};
use crate::geometry::{Cloud, Pose};
use crate::mesh::Mesh;
use crate::mesh::io::{Unit, read_cloud_in};
use crate::reconstruct::{ReconstructParams, reconstruct};
use crate::register::{PreparedScan, RegisterParams, Registration, Status, register};
use crate::scans::{PoseSigma, ScanSource, Support};
use crate::verdict::{ModelVerdict, ScanCount};
use crate::{Error, Progress, Result};
use sha2::{Digest, Sha256};
use std::path::Path;

crate::param_groups! {
    /// Parameters of all stages.
    pub struct Params {
        /// Of the registration.
        register: RegisterParams,
        /// Of the filter.
        filter: FilterParams,
        /// Of the reconstruction.
        reconstruct: ReconstructParams,
    }
}

/// What a mesh can be made of.
pub enum Input {
    /// Scans with the robot's poses.
    Scans(ScanSource),
    /// One cloud of registered points with normals.
    Cloud(Cloud),
}

impl Input {
    /// Opens a scan folder, a Stanford `.conf`, or a single PLY with normals.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`] or [`Error::Input`] with what is wrong and what to do.
    pub fn open(path: &Path, unit: Unit) -> Result<Input> {
        std::fs::metadata(path).map_err(|error| Error::io("read", path, error))?;
        let is_ply = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("ply"));
        if is_ply && path.is_file() {
            return Ok(Input::Cloud(read_cloud_in(path, unit)?));
        }
        Ok(Input::Scans(ScanSource::open(path, unit)?))
    }
}

/// How the poses of the input are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Poses {
    /// As a robot reports them: the scans are registered.
    Robot,
    /// As exact: the scans are not registered.
    Exact,
}

/// Scans made ready: oriented points, poses, and the hash of all that went in.
pub struct Prepared {
    /// Oriented points of each scan, sensor frame.
    pub scans: Vec<PreparedScan>,
    /// Name of each scan.
    pub names: Vec<String>,
    /// The robot's `object_from_sensor` of each scan.
    pub robot: Vec<Pose>,
    /// Standard deviation of those poses, if known.
    pub pose_sigma: Option<PoseSigma>,
}

/// Reads all scans and estimates their normals.
///
/// # Errors
/// As [`ScanSource::view`], and [`Error::Input`] naming the view that cannot be used; [`Error::Cancelled`].
pub fn prepare(files: &ScanSource, progress: &Progress) -> Result<Prepared> {
    let mut prepared = Prepared {
        scans: Vec::new(),
        names: Vec::new(),
        robot: Vec::new(),
        pose_sigma: files.pose_sigma,
    };
    for index in 0..files.len() {
        progress.report("read", index as f64 / files.len() as f64)?;
        let view = files.view(index)?;
        let scan = PreparedScan::new(&view.scan)
            .map_err(|error| Error::input(format!("view {}: {error}", view.name)))?;
        prepared.scans.push(scan);
        prepared.names.push(view.name);
        prepared.robot.push(view.object_from_sensor);
    }
    progress.report("read", 1.0)?;
    Ok(prepared)
}

/// Registers the scans, unless their poses are exact.
///
/// # Errors
/// As [`register`].
pub fn register_scans(
    prepared: &Prepared,
    poses: Poses,
    params: &RegisterParams,
    progress: &Progress,
) -> Result<Registration> {
    match poses {
        Poses::Robot => {
            register(&prepared.scans, &prepared.robot, prepared.pose_sigma, params, progress)
        }
        Poses::Exact => Ok(Registration::exact(&prepared.scans, &prepared.robot)),
    }
}

/// Combines the accepted scans.
///
/// # Errors
/// As [`filter`].
pub fn filter_scans(
    prepared: &Prepared,
    registration: &Registration,
    params: &FilterParams,
    progress: &Progress,
) -> Result<Filtered> {
    let accepted = |i: &usize| registration.verdicts[*i].status == Status::Accepted;
    let scans: Vec<(&PreparedScan, Pose)> = (0..prepared.scans.len())
        .filter(accepted)
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

/// The comment lines of a mesh file: program, seed, and the hash of the cloud that the mesh was made of.
pub fn comments(cloud: &Cloud, seed: u64) -> [String; 3] {
    [
        format!("puffer {}", env!("CARGO_PKG_VERSION")),
        format!("seed {seed}"),
        format!("cloud sha256 {}", cloud_hash(cloud)),
    ]
}

/// What the whole way gives.
pub struct Outcome {
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

/// From input to mesh. What the scans say of the object's support counts unless `params` say something else.
///
/// # Errors
/// Those of the stages.
pub fn run(input: &Input, poses: Poses, params: &Params, progress: &Progress) -> Result<Outcome> {
    let files = match input {
        Input::Cloud(cloud) => {
            let mesh = reconstruct(cloud, &params.reconstruct, progress)?;
            let verdict = ModelVerdict::new(None, cloud, &mesh);
            let (cloud, measurements) = (cloud.clone(), cloud.len());
            return Ok(Outcome {
                mesh,
                cloud,
                measurements,
                registration: None,
                names: Vec::new(),
                verdict,
            });
        }
        Input::Scans(files) => files,
    };
    let prepared = prepare(files, progress)?;
    let registration = register_scans(&prepared, poses, &params.register, progress)?;
    let filtered = filter_scans(&prepared, &registration, &params.filter, progress)?;
    let mut of_reconstruct = params.reconstruct.clone();
    if of_reconstruct.support == Support::None {
        of_reconstruct.support = files.support;
    }
    let mesh = reconstruct(&filtered.cloud, &of_reconstruct, progress)?;
    let scans = ScanCount::from_verdicts(&registration.verdicts);
    Ok(Outcome {
        verdict: ModelVerdict::new(scans, &filtered.cloud, &mesh),
        mesh,
        cloud: filtered.cloud,
        measurements: filtered.measurements,
        registration: Some(registration),
        names: prepared.names,
    })
}
