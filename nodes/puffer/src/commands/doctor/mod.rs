//! `puffer doctor`: is this machine fit?

mod host;
mod network;

use crate::table::print_text;
use anyhow::{Result, bail};
use clap::Args;
use serde_json::{Value, json};

/// Checks cores, memory, space, clock, sockets, DDS domain and discovery, each with the line that mends it.
#[derive(Args)]
pub struct Doctor {
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

/// How a check went.
#[derive(Clone, Copy, PartialEq)]
enum Finding {
    Good,
    /// Works, but something is better.
    Advice,
    Bad,
}

struct Check {
    name: &'static str,
    finding: Finding,
    found: String,
    /// The line that mends it.
    mend: String,
}

impl Check {
    /// A check that is good or bad.
    fn new(name: &'static str, good: bool, found: impl Into<String>, mend: &str) -> Check {
        let finding = if good { Finding::Good } else { Finding::Bad };
        Check { name, finding, found: found.into(), mend: mend.to_owned() }
    }

    fn print(&self) {
        let word = match self.finding {
            Finding::Good => "ok",
            Finding::Advice => "note",
            Finding::Bad => "FAIL",
        };
        print_text(&format!("{word:<4}  {:<16}  {}\n", self.name, self.found));
        if self.finding != Finding::Good {
            print_text(&format!("      mend: {}\n", self.mend));
        }
    }

    fn as_json(&self) -> Value {
        json!({
            "good": self.finding != Finding::Bad,
            "advice": self.finding == Finding::Advice,
            "found": self.found,
            "mend": self.mend,
        })
    }
}

impl Doctor {
    pub(super) fn run(&self) -> Result<()> {
        let mut checks = host::checks();
        checks.extend(network::checks());
        if self.json {
            let entry = |check: &Check| (check.name.to_owned(), check.as_json());
            let all = Value::Object(checks.iter().map(entry).collect());
            print_text(&format!("{all}\n"));
        } else {
            checks.iter().for_each(Check::print);
        }
        let failed: Vec<&str> =
            checks.iter().filter(|c| c.finding == Finding::Bad).map(|c| c.name).collect();
        if !failed.is_empty() {
            bail!("{} of {} checks failed: {}", failed.len(), checks.len(), failed.join(", "));
        }
        Ok(())
    }
}
