//! Arguments that several commands share.

use super::bag::Notes;
use crate::failure::usage;
use crate::parameters::ParameterArgs;
use anyhow::Result;
use clap::{Args, ValueEnum};
use puffer_core::Error;
use puffer_core::Progress;
use puffer_core::filter::FilterParams;
use puffer_core::mesh::io::Unit;
use puffer_core::pipeline::{Input, Params, Poses};
use puffer_core::reconstruct::ReconstructParams;
use puffer_core::register::RegisterParams;
use puffer_core::scans::ScanSource;
use puffer_shell::scans::{RegistrarParams, ScanParams, is_bag, scans_of_bag};
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
    pub(crate) fn of_registrar(&self) -> RegistrarParams {
        RegistrarParams { scan: self.scan.clone(), register: self.register.clone() }
    }
}

/// Defaults, overridden by what the run had that made the bag, overridden by the user.
pub(crate) fn bag_params(notes: &Notes, parameters: &ParameterArgs) -> Result<BagParams> {
    let mut params = BagParams::default();
    notes.apply(&mut params, "scan_registrar", &["scan", "register"])?;
    notes.apply(&mut params, "cloud_filter", &["filter"])?;
    notes.apply(&mut params, "mesh_reconstructor", &["reconstruct"])?;
    parameters.load_onto(params)
}

/// The data, and how it is worked on.
pub(crate) struct Job<T> {
    pub data: T,
    pub params: Params,
    /// Seed of the run that a bag came from.
    pub seed: Option<u64>,
}

impl InputArgs {
    /// Opens the data.
    pub(crate) fn open(
        &self,
        parameters: &ParameterArgs,
        progress: &Progress,
    ) -> Result<Job<Input>> {
        if is_bag(&self.path) {
            return self.open_bag(parameters, progress);
        }
        let params = parameters.load()?;
        Ok(Job { data: Input::open(&self.path, self.unit())?, params, seed: None })
    }

    fn open_bag(&self, parameters: &ParameterArgs, progress: &Progress) -> Result<Job<Input>> {
        if self.unit() != Unit::M {
            return Err(usage(format!(
                "{}: a bag's clouds are in metres; leave --unit out",
                self.path.display()
            )));
        }
        let notes = Notes::read(&self.path)?;
        let params = bag_params(&notes, parameters)?;
        let scans = scans_of_bag(&self.path, &params.of_registrar(), progress)?;
        let seed = notes.get("mesh_reconstructor", "mesh", "seed").and_then(|v| v.as_u64());
        let BagParams { register, filter, reconstruct, .. } = params;
        let params = Params { register, filter, reconstruct };
        Ok(Job { data: Input::Scans(ScanSource::of(scans)), params, seed })
    }

    /// Opens the data, which must be scans.
    pub(crate) fn open_scans(
        &self,
        parameters: &ParameterArgs,
        progress: &Progress,
    ) -> Result<Job<ScanSource>> {
        let Job { data, params, seed } = self.open(parameters, progress)?;
        match data {
            Input::Scans(data) => Ok(Job { data, params, seed }),
            Input::Cloud(_) => Err(usage(format!(
                "{} is a single cloud: there is nothing to register; give a scan folder or a .conf",
                self.path.display()
            ))),
        }
    }

    /// Puts the input's name before an error that tells no file of its own.
    pub(crate) fn named<T>(&self, result: puffer_core::Result<T>) -> Result<T> {
        result.map_err(|error| match error {
            Error::Input(_) => anyhow::Error::new(error).context(self.path.display().to_string()),
            other => other.into(),
        })
    }

    pub(crate) fn unit(&self) -> Unit {
        match self.unit {
            UnitArg::M => Unit::M,
            UnitArg::Mm => Unit::Mm,
        }
    }

    pub(crate) fn poses(&self) -> Poses {
        match self.poses {
            PosesArg::Robot => Poses::Robot,
            PosesArg::Exact => Poses::Exact,
        }
    }
}

/// Checks before any work that `path` has one of `extensions` and its folder exists.
pub(crate) fn check_output(path: &Path, extensions: &[&str]) -> Result<()> {
    let given = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if !extensions.contains(&given.as_str()) {
        return Err(usage(format!(
            "{}: the name must end in .{}",
            path.display(),
            extensions.join(", .")
        )));
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|f| !f.is_dir()) {
        return Err(usage(format!("{}: there is no folder {}", path.display(), folder.display())));
    }
    Ok(())
}
