//! `puffer bench`: hands its arguments on to the program `puffer-bench`, for scripts that call the
//! benchmarks by their former name.

use anyhow::{Context, Result, anyhow};
use clap::Args;
use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::process::Command;

/// Runs `puffer-bench`, which lies in the folder of this program.
#[derive(Args)]
#[command(disable_help_flag = true)]
pub struct Bench {
    /// Arguments of `puffer-bench`
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    args: Vec<OsString>,
}

impl Bench {
    /// Replaces this process, so that signals and exit status are those of `puffer-bench`.
    pub(super) fn run(&self) -> Result<()> {
        let program = std::env::current_exe()
            .context("the folder of this program is unknown")?
            .with_file_name("puffer-bench");
        let error = Command::new(&program)
            .args(&self.args)
            .env("RAYON_NUM_THREADS", rayon::current_num_threads().to_string())
            .exec();
        Err(anyhow!(
            "cannot start {}: {error}; `cargo build --release -p puffer_bench` makes it",
            program.display()
        ))
    }
}
