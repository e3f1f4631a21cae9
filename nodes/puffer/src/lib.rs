//! The command line of puffer. Each command is one file in [`commands`]; this one parses and reports.

pub mod commands;
mod failure;
mod fleet;
mod nodes;
mod parameters;
mod picture;
mod progress;
mod run;
mod setups;
mod table;
mod verdict;

use clap::Parser;
use commands::Command;
use std::ffi::OsString;
use std::process::ExitCode;

/// Models unknown objects: from scans to a watertight mesh with an uncertainty at every vertex.
#[derive(Parser)]
#[command(name = "puffer", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Threads to use [default: one for each core]
    #[arg(long, global = true, value_name = "N")]
    threads: Option<usize>,
}

/// Runs the program with `args`, of which the first is its own name.
///
/// Exit status: 0 done, 1 failed, 2 wrong usage, 130 interrupted; on failure one message on standard error.
pub fn run(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let cli = match Cli::try_parse_from(args) {
        Ok(cli) => cli,
        Err(error) => {
            let status = if error.use_stderr() { failure::USAGE } else { 0 };
            // Nobody is left to tell if the terminal is gone.
            let _ = error.print();
            return ExitCode::from(status);
        }
    };
    match set_threads(cli.threads).and_then(|()| cli.command.run()) {
        Ok(status) => status,
        Err(error) => {
            eprintln!("puffer: {error:#}");
            ExitCode::from(failure::status(&error))
        }
    }
}

fn set_threads(threads: Option<usize>) -> anyhow::Result<()> {
    let Some(threads) = threads else { return Ok(()) };
    if !(1..=1024).contains(&threads) {
        return Err(failure::usage(format!("--threads {threads}: allowed are 1 to 1024")));
    }
    Ok(rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?)
}
