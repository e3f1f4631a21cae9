//! `puffer bag`: bags of ROS 2 messages.

mod command_node;
mod info;
mod play;
mod played_scans;
mod record;
mod scans;
pub(crate) mod topics;

use anyhow::Result;
use clap::{Args, Subcommand};

/// Looks into, records and plays MCAP bags, and takes the scans out of them.
#[derive(Args)]
pub struct BagCommand {
    #[command(subcommand)]
    command: BagAction,
}

#[derive(Subcommand)]
enum BagAction {
    /// Tell what is in a bag
    Info(info::InfoCommand),
    /// Record topics until Ctrl-C
    Record(record::RecordCommand),
    /// Publish what a bag holds
    Play(play::PlayCommand),
    /// Write the scans of a bag as a scan folder
    Scans(scans::ScansCommand),
}

impl BagCommand {
    pub(super) fn run(&self) -> Result<()> {
        match &self.command {
            BagAction::Info(command) => command.run(),
            BagAction::Record(command) => command.run(),
            BagAction::Play(command) => command.run(),
            BagAction::Scans(command) => command.run(),
        }
    }
}
