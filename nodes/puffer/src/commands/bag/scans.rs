//! `puffer bag scans`.

use crate::commands::input::bag_params;
use crate::exit_status::usage_error;
use crate::notes::BagNotes;
use crate::parameters::ParameterArgs;
use crate::progress::TerminalProgress;
use anyhow::Result;
use clap::Args;
use puffer_core::scan_files::write_scans;
use puffer_ros::scans::scans_of_bag;
use std::path::PathBuf;

/// Cuts the clouds of a bag as scan_registrar does and writes them with the robot's poses.
#[derive(Args)]
pub struct ScansCommand {
    /// An .mcap file, or a rosbag2 folder of them
    #[arg(value_name = "BAG")]
    path: PathBuf,
    /// Scan folder to write, new or empty
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    parameters: ParameterArgs,
}

impl ScansCommand {
    pub(super) fn run(&self) -> Result<()> {
        if std::fs::read_dir(&self.output).is_ok_and(|mut entries| entries.next().is_some()) {
            return Err(usage_error(format!(
                "-o {}: holds something already",
                self.output.display()
            )));
        }
        let notes = BagNotes::read(&self.path)?;
        let params = bag_params(&notes, &self.parameters)?;
        let watch = TerminalProgress::start();
        let mut set = scans_of_bag(&self.path, &params.registrar_params(), watch.progress())?;
        watch.finish();
        (set.sensor, set.support) = (notes.sensor(), notes.support());
        write_scans(&self.output, &set, &[])?;
        println!("{} scans in {}", set.views.len(), self.output.display());
        Ok(())
    }
}
