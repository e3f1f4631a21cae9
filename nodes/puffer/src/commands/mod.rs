//! The commands of `puffer`.

pub(crate) mod bag;
mod bench;
mod doctor;
mod evaluate;
mod filter;
mod input;
mod launch;
mod model;
mod node;
mod objects;
mod params;
mod reconstruct;
mod register;
mod render;
mod simulate;

use anyhow::Result;
use clap::Subcommand;
use std::process::ExitCode;

/// What to do.
#[derive(Subcommand)]
pub enum Command {
    /// Model an object from the first view to the mesh, with a simulated robot
    Model(model::Model),
    /// Start the nodes, for play or for a real robot
    Launch(launch::Launch),
    /// Run one node
    Node(node::Node),
    /// Make a watertight mesh from scans
    Reconstruct(reconstruct::Reconstruct),
    /// Correct the poses of scans
    Register(register::Register),
    /// Combine scans to one cloud with uncertainty
    Filter(filter::Filter),
    /// Scan an object with a simulated robot and sensor
    Simulate(simulate::Simulate),
    /// Measure a mesh against the truth
    Evaluate(evaluate::Evaluate),
    /// Draw a mesh
    Render(render::Render),
    /// List the objects that can be simulated
    Objects(objects::Objects),
    /// List the parameters with their defaults, ranges and units
    Params(params::Params),
    /// Record, play and look into bags
    Bag(bag::Bag),
    /// Measure a part on this machine
    Bench(bench::Bench),
    /// Check this machine
    Doctor(doctor::Doctor),
}

impl Command {
    /// Carries the command out.
    ///
    /// # Errors
    /// Whatever stopped it, in words for the user.
    pub fn run(&self) -> Result<ExitCode> {
        match self {
            Command::Node(command) => return command.run(),
            Command::Model(command) => command.run(),
            Command::Launch(command) => command.run(),
            Command::Reconstruct(command) => command.run(),
            Command::Register(command) => command.run(),
            Command::Filter(command) => command.run(),
            Command::Simulate(command) => command.run(),
            Command::Evaluate(command) => command.run(),
            Command::Render(command) => command.run(),
            Command::Objects(command) => command.run(),
            Command::Params(command) => command.run(),
            Command::Bag(command) => command.run(),
            Command::Bench(command) => command.run(),
            Command::Doctor(command) => command.run(),
        }?;
        Ok(ExitCode::SUCCESS)
    }
}
