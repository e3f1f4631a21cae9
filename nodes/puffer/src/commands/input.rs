//! Arguments that several commands share.

use crate::exit_status::usage_error;
use crate::notes::BagNotes;
use crate::parameters::ParameterArgs;
use anyhow::Result;
use clap::{Args, ValueEnum};
use puffer_core::Error;
use puffer_core::Progress;
use puffer_core::filter::FilterParams;
use puffer_core::mesh::io::Unit;
use puffer_core::pipeline::{PipelineInput, PipelineParams, PoseSource};
use puffer_core::reconstruct::ReconstructParams;
use puffer_core::register::RegisterParams;
use puffer_core::scan_files::ScanSource;
use puffer_ros::scans::{RegistrarParams, ScanParams, is_bag, scans_of_bag};
use std::path::{Path, PathBuf};

/// The data to work on.
#[derive(Args)]
pub struct InputArgs {
    /// Scan folder, bag (.mcap or a rosbag2 folder), Stanford .conf, or a single PLY with normals
    #[arg(value_name = "INPUT")]
    pub(crate) path: PathBuf,
    /// How to take the poses of the scans
    #[arg(long, value_enum, default_value_t = PosesArg::Robot)]
    poses: PosesArg,
    /// Unit of the coordinates in INPUT
    #[arg(long, value_enum, default_value_t = UnitArg::M)]
    unit: UnitArg,
}

#[derive(Clone, Copy, ValueEnum)]
enum PosesArg {
    /// As a robot reports them: the scans are registered
    Robot,
    /// As exact: the scans are not registered
    Exact,
}

#[derive(Clone, Copy, ValueEnum)]
enum UnitArg {
    /// Metres
    M,
    /// Millimetres
    Mm,
}

puffer_core::param_groups! {
    /// What counts for a bag.
    pub struct BagParams {
        /// Which points of its clouds count.
        scan: ScanParams,
        /// How scans are registered.
        register: RegisterParams,
        /// How they are combined.
        filter: FilterParams,
        /// How a mesh is made.
        reconstruct: ReconstructParams,
    }
}

impl BagParams {
    pub(crate) fn registrar_params(&self) -> RegistrarParams {
        RegistrarParams { scan: self.scan.clone(), register: self.register.clone() }
    }
}

/// Defaults, overridden by what the run had that made the bag, overridden by the user.
pub(crate) fn bag_params(notes: &BagNotes, parameters: &ParameterArgs) -> Result<BagParams> {
    let mut params = BagParams::default();
    notes.apply(&mut params, "scan_registrar", &["scan", "register"])?;
    notes.apply(&mut params, "cloud_filter", &["filter"])?;
    notes.apply(&mut params, "mesh_reconstructor", &["reconstruct"])?;
    parameters.load_onto(params)
}

/// The data, and how it is worked on.
pub(crate) struct OpenedInput<T> {
    pub data: T,
    pub params: PipelineParams,
    /// Seed of the run that a bag came from.
    pub seed: Option<u64>,
}

impl InputArgs {
    /// Opens the data.
    pub(crate) fn open(
        &self,
        parameters: &ParameterArgs,
        progress: &Progress,
    ) -> Result<OpenedInput<PipelineInput>> {
        if is_bag(&self.path) {
            return self.open_bag(parameters, progress);
        }
        let params = parameters.load()?;
        Ok(OpenedInput { data: PipelineInput::open(&self.path, self.unit())?, params, seed: None })
    }

    fn open_bag(
        &self,
        parameters: &ParameterArgs,
        progress: &Progress,
    ) -> Result<OpenedInput<PipelineInput>> {
        if self.unit() != Unit::Metre {
            return Err(usage_error(format!(
                "{}: a bag's clouds are in metres; leave --unit out",
                self.path.display()
            )));
        }
        let notes = BagNotes::read(&self.path)?;
        let params = bag_params(&notes, parameters)?;
        let scans = scans_of_bag(&self.path, &params.registrar_params(), progress)?;
        let seed = notes.get("mesh_reconstructor", "mesh", "seed").and_then(|v| v.as_u64());
        let BagParams { register, filter, reconstruct, .. } = params;
        let params = PipelineParams { register, filter, reconstruct };
        Ok(OpenedInput { data: PipelineInput::Scans(ScanSource::from_set(scans)), params, seed })
    }

    /// Opens the data, which must be scans.
    pub(crate) fn open_scans(
        &self,
        parameters: &ParameterArgs,
        progress: &Progress,
    ) -> Result<OpenedInput<ScanSource>> {
        let OpenedInput { data, params, seed } = self.open(parameters, progress)?;
        match data {
            PipelineInput::Scans(data) => Ok(OpenedInput { data, params, seed }),
            PipelineInput::Cloud(_) => Err(usage_error(format!(
                "{} is a single cloud: there is nothing to register; give a scan folder or a .conf",
                self.path.display()
            ))),
        }
    }

    /// Puts the input's name before an error that names no file itself.
    pub(crate) fn with_input_name<T>(&self, result: puffer_core::Result<T>) -> Result<T> {
        result.map_err(|error| match error {
            Error::Input(_) => anyhow::Error::new(error).context(self.path.display().to_string()),
            other => other.into(),
        })
    }

    pub(crate) fn unit(&self) -> Unit {
        match self.unit {
            UnitArg::M => Unit::Metre,
            UnitArg::Mm => Unit::Millimetre,
        }
    }

    pub(crate) fn poses(&self) -> PoseSource {
        match self.poses {
            PosesArg::Robot => PoseSource::Robot,
            PosesArg::Exact => PoseSource::Exact,
        }
    }
}

/// Checks before any work that `path` has one of `extensions` and its folder exists.
pub(crate) fn check_output(path: &Path, extensions: &[&str]) -> Result<()> {
    let given = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if !extensions.contains(&given.as_str()) {
        return Err(usage_error(format!(
            "{}: the name must end in .{}",
            path.display(),
            extensions.join(", .")
        )));
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|f| !f.is_dir()) {
        return Err(usage_error(format!(
            "{}: there is no folder {}",
            path.display(),
            folder.display()
        )));
    }
    Ok(())
}
