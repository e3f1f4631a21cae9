//! The command line of puffer. Each command is one file in [`commands`]; this one parses and
//! reports.

pub mod commands;
pub mod exit_status;
mod launcher;
mod modelling_run;
mod nodes;
mod notes;
pub mod parameters;
mod png_file;
mod progress;
mod setups;
pub mod table;
mod verdict_report;

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

/// Runs the program `puffer` with `args`, of which the first is its own name. See [`run_program`].
pub fn run(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    run_program(args, |cli: Cli| {
        set_threads(cli.threads)?;
        cli.command.run()
    })
}

/// Parses `args`, of which the first is the program's own name, and hands them to `execute`.
///
/// Exit status: 0 done, 1 failed, 2 wrong usage, 130 interrupted; on failure one message on
/// standard error.
pub fn run_program<C: Parser>(
    args: impl IntoIterator<Item = OsString>,
    execute: impl FnOnce(C) -> anyhow::Result<ExitCode>,
) -> ExitCode {
    let cli = match C::try_parse_from(args) {
        Ok(cli) => cli,
        Err(error) => {
            let status = if error.use_stderr() { exit_status::USAGE_STATUS } else { 0 };
            // There is nowhere to report that the terminal is gone.
            let _ = error.print();
            return ExitCode::from(status);
        }
    };
    match execute(cli) {
        Ok(status) => status,
        Err(error) => {
            eprintln!("{}: {error:#}", C::command().get_name());
            ExitCode::from(exit_status::exit_status(&error))
        }
    }
}

/// Makes computations use this number of threads; `None`: one for each core.
///
/// # Errors
/// Wrong usage if the number is not between 1 and 1024.
pub fn set_threads(threads: Option<usize>) -> anyhow::Result<()> {
    let Some(threads) = threads else { return Ok(()) };
    if !(1..=1024).contains(&threads) {
        return Err(exit_status::usage_error(format!(
            "--threads {threads}: allowed are 1 to 1024"
        )));
    }
    Ok(rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?)
}
