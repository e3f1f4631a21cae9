//! The `puffer-bench` program: measures parts of the system on this machine.

mod filter;
mod registration;
mod simulated_input;
mod transport;

use anyhow::Result;
use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Measures a part of the system on this machine.
#[derive(Parser)]
#[command(name = "puffer-bench", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    benchmark: Benchmark,
    /// Threads to use [default: one for each core]
    #[arg(long, global = true, value_name = "N")]
    threads: Option<usize>,
}

#[derive(Subcommand)]
enum Benchmark {
    /// Filter simulated scans, and measure the cloud against the truth
    Filter(filter::FilterBenchmark),
    /// Register simulated scans, and measure the poses against the truth
    Registration(registration::RegistrationBenchmark),
    /// Send large samples from one process to others, and check every byte
    Transport(transport::TransportBenchmark),
    /// One process of the transport benchmark
    #[command(hide = true)]
    TransportChild(transport::Endpoint),
}

impl Benchmark {
    fn run(&self) -> Result<()> {
        match self {
            Benchmark::Filter(command) => command.run(),
            Benchmark::Registration(command) => command.run(),
            Benchmark::Transport(command) => command.run(),
            Benchmark::TransportChild(command) => command.run(),
        }
    }
}

fn main() -> ExitCode {
    puffer::run_program(std::env::args_os(), |cli: Cli| {
        puffer::set_threads(cli.threads)?;
        cli.benchmark.run()?;
        Ok(ExitCode::SUCCESS)
    })
}
