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
pub mod simulate;

use anyhow::Result;
use clap::Subcommand;
use std::process::ExitCode;

/// What to do.
#[derive(Subcommand)]
pub enum Command {
    /// Model an object from the first view to the mesh, with a simulated robot
    Model(model::ModelCommand),
    /// Start the nodes, for play or for a real robot
    Launch(launch::LaunchCommand),
    /// Run one node
    Node(node::NodeCommand),
    /// Make a watertight mesh from scans
    Reconstruct(reconstruct::ReconstructCommand),
    /// Correct the poses of scans
    Register(register::RegisterCommand),
    /// Combine scans to one cloud with uncertainty
    Filter(filter::FilterCommand),
    /// Scan an object with a simulated robot and sensor
    Simulate(simulate::SimulateCommand),
    /// Measure a mesh against the truth
    Evaluate(evaluate::EvaluateCommand),
    /// Draw a mesh
    Render(render::RenderCommand),
    /// List the objects that can be simulated
    Objects(objects::ObjectsCommand),
    /// List the parameters with their defaults, ranges and units
    Params(params::ParamsCommand),
    /// Record, play and look into bags
    Bag(bag::BagCommand),
    /// The program `puffer-bench` by its former name
    #[command(hide = true)]
    Bench(bench::Bench),
    /// Check this machine
    Doctor(doctor::DoctorCommand),
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
