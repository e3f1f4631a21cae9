//! `puffer bag`: bags of ROS 2 messages.

mod finish;
mod info;
mod node;
mod notes;
mod play;
mod record;
mod scans;
pub(crate) mod topics;

pub(crate) use notes::Notes;

use anyhow::Result;
use clap::{Args, Subcommand};

/// Looks into, records and plays MCAP bags, and takes the scans out of them.
#[derive(Args)]
pub struct Bag {
    #[command(subcommand)]
    command: BagCommand,
}

#[derive(Subcommand)]
enum BagCommand {
    /// Tell what is in a bag
    Info(info::Info),
    /// Record topics until Ctrl-C
    Record(record::Record),
    /// Publish what a bag holds
    Play(play::Play),
    /// Write the scans of a bag as a scan folder
    Scans(scans::Scans),
}

impl Bag {
    pub(super) fn run(&self) -> Result<()> {
        match &self.command {
            BagCommand::Info(command) => command.run(),
            BagCommand::Record(command) => command.run(),
            BagCommand::Play(command) => command.run(),
            BagCommand::Scans(command) => command.run(),
        }
    }
}
