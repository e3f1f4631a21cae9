//! `puffer bag scans`.

use super::Notes;
use crate::commands::input::bag_params;
use crate::failure::usage;
use crate::parameters::ParameterArgs;
use crate::progress::Watch;
use anyhow::Result;
use clap::Args;
use puffer_core::scans::write_scans;
use puffer_shell::scans::scans_of_bag;
use std::path::PathBuf;

/// Cuts the clouds of a bag as scan_registrar does and writes them with the robot's poses.
#[derive(Args)]
pub struct Scans {
    /// An .mcap file, or a rosbag2 folder of them
    #[arg(value_name = "BAG")]
    path: PathBuf,
    /// Scan folder to write, new or empty
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    parameters: ParameterArgs,
}

impl Scans {
    pub(super) fn run(&self) -> Result<()> {
        if std::fs::read_dir(&self.output).is_ok_and(|mut entries| entries.next().is_some()) {
            return Err(usage(format!("-o {}: holds something already", self.output.display())));
        }
        let notes = Notes::read(&self.path)?;
        let params = bag_params(&notes, &self.parameters)?;
        let watch = Watch::start();
        let mut set = scans_of_bag(&self.path, &params.of_registrar(), watch.progress())?;
        watch.finish();
        (set.sensor, set.support) = (notes.sensor(), notes.support());
        write_scans(&self.output, &set, &[])?;
        println!("{} scans in {}", set.views.len(), self.output.display());
        Ok(())
    }
}
