//! `puffer bench`: measurements of the parts.

mod child;
mod memory;
mod payload;
mod process;
mod registration;
mod transport;

use anyhow::Result;
use clap::{Args, Subcommand};

/// Measures a part of the system on this machine.
#[derive(Args)]
pub struct Bench {
    #[command(subcommand)]
    part: Part,
}

#[derive(Subcommand)]
enum Part {
    /// Register simulated scans, and measure the poses against the truth
    Registration(registration::Registration),
    /// Send large samples from one process to others, and check every byte
    Transport(transport::Transport),
    /// One process of the transport benchmark
    #[command(hide = true)]
    TransportChild(child::Child),
}

impl Bench {
    pub(super) fn run(&self) -> Result<()> {
        match &self.part {
            Part::Registration(command) => command.run(),
            Part::Transport(command) => command.run(),
            Part::TransportChild(command) => command.run(),
        }
    }
}
