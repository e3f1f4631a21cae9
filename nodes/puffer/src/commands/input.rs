//! Arguments that several commands share.

use crate::failure::usage;
use anyhow::Result;
use clap::{Args, ValueEnum};
use puffer_core::Error;
use puffer_core::mesh::io::Unit;
use puffer_core::pipeline::{Input, Poses};
use puffer_core::scans::ScanSource;
use std::path::{Path, PathBuf};

/// The data to work on.
#[derive(Args)]
pub struct InputArgs {
    /// Scan folder, Stanford .conf, or a single PLY with normals
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

impl InputArgs {
    /// Opens the data.
    pub(crate) fn open(&self) -> Result<Input> {
        Ok(Input::open(&self.path, self.unit())?)
    }

    /// Opens the data, which must be scans.
    pub(crate) fn open_scans(&self) -> Result<ScanSource> {
        match self.open()? {
            Input::Scans(files) => Ok(files),
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
