//! `puffer doctor`: is this machine fit?

mod check;
mod host;
mod network;

use crate::table::print_text;
use anyhow::{Result, bail};
use check::{Check, CheckOutcome};
use clap::Args;
use serde_json::Value;

/// Checks cores, memory, space, clock, sockets, DDS domain and discovery, each with the line that
/// mends it.
#[derive(Args)]
pub struct DoctorCommand {
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

impl DoctorCommand {
    pub(super) fn run(&self) -> Result<()> {
        let mut checks = host::checks();
        checks.extend(network::checks());
        if self.json {
            let all = checks.iter().map(|check| (check.name.to_owned(), check.as_json()));
            let all = Value::Object(all.collect());
            print_text(&format!("{all}\n"));
        } else {
            checks.iter().for_each(Check::print);
        }
        let failed: Vec<&str> =
            checks.iter().filter(|c| c.finding == CheckOutcome::Bad).map(|c| c.name).collect();
        if !failed.is_empty() {
            bail!("{} of {} checks failed: {}", failed.len(), checks.len(), failed.join(", "));
        }
        Ok(())
    }
}
