//! `puffer bench`: measurements of the parts.

mod child;
mod filter;
mod memory;
mod payload;
mod process;
mod registration;
mod transport;

use crate::failure::usage;
use anyhow::{Context, Result};
use clap::{Args, Subcommand};
use puffer_core::params::ParamValue;
use puffer_core::register::PreparedScan;
use puffer_core::simulate::{NoiseFamily, SimulatedScans, SimulatedView};
use serde_json::Value;

/// Measures a part of the system on this machine.
#[derive(Args)]
pub struct Bench {
    #[command(subcommand)]
    part: Part,
}

#[derive(Subcommand)]
enum Part {
    /// Filter simulated scans, and measure the cloud against the truth
    Filter(filter::Filter),
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
            Part::Filter(command) => command.run(),
            Part::Registration(command) => command.run(),
            Part::Transport(command) => command.run(),
            Part::TransportChild(command) => command.run(),
        }
    }
}

/// The noise family that the command line names.
fn family(word: &str) -> Result<NoiseFamily> {
    NoiseFamily::from_value(&Value::from(word)).ok_or_else(|| {
        usage(format!("--noise {word}: there is {}", NoiseFamily::CHOICES.join(", ")))
    })
}

/// The scans made ready for registration and filter.
fn prepared(scans: &SimulatedScans) -> Result<Vec<PreparedScan>> {
    let view = |(i, v): (usize, &SimulatedView)| {
        PreparedScan::new(&v.scan).with_context(|| format!("view {i}"))
    };
    scans.views.iter().enumerate().map(view).collect()
}
