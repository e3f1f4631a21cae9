//! `puffer doctor`: is this machine fit?

use anyhow::{Result, bail};
use clap::Args;
use std::path::Path;

/// Checks cores, memory and free space, each with the line that mends it.
#[derive(Args)]
pub struct Doctor {
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

struct Check {
    name: &'static str,
    good: bool,
    found: String,
    mend: &'static str,
}

impl Doctor {
    pub(super) fn run(&self) -> Result<()> {
        let checks = [cores(), memory(), temporary_space()];
        if self.json {
            let entry = |c: &Check| {
                let value = serde_json::json!({ "good": c.good, "found": c.found, "mend": c.mend });
                (c.name.to_owned(), value)
            };
            println!("{}", serde_json::Value::Object(checks.iter().map(entry).collect()));
        } else {
            for check in &checks {
                println!(
                    "{}  {:<16}  {}",
                    if check.good { "ok  " } else { "FAIL" },
                    check.name,
                    check.found
                );
                if !check.good {
                    println!("      mend: {}", check.mend);
                }
            }
        }
        match checks.iter().filter(|c| !c.good).count() {
            0 => Ok(()),
            failed => bail!("{failed} of {} checks failed", checks.len()),
        }
    }
}

fn cores() -> Check {
    let cores = std::thread::available_parallelism().map_or(0, std::num::NonZero::get);
    Check {
        name: "processor cores",
        good: cores >= 1,
        found: cores.to_string(),
        mend: "check the process's CPU affinity (taskset -p $$)",
    }
}

/// Enough for a few million points.
const LEAST_MEMORY_GB: f64 = 2.0;

fn memory() -> Check {
    let text = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let kilobytes = text
        .lines()
        .find(|line| line.starts_with("MemAvailable:"))
        .and_then(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok());
    Check {
        name: "free memory",
        good: kilobytes.is_none_or(|kb| kb * 1024.0 / 1e9 >= LEAST_MEMORY_GB),
        found: kilobytes
            .map_or_else(|| "unknown".into(), |kb| format!("{:.1} GB", kb * 1024.0 / 1e9)),
        mend: "close other programs; 2 GB hold a few million points",
    }
}

fn temporary_space() -> Check {
    let folder = std::env::temp_dir();
    let probe = folder.join(format!("puffer-doctor-{}", std::process::id()));
    let outcome = write_probe(&probe);
    Check {
        name: "temporary files",
        good: outcome.is_ok(),
        found: match &outcome {
            Ok(()) => format!("{} can be written", folder.display()),
            Err(error) => format!("{}: {error}", folder.display()),
        },
        mend: "free space there, or set TMPDIR to a folder with space",
    }
}

/// Writes and removes a megabyte.
fn write_probe(path: &Path) -> std::io::Result<()> {
    let written = std::fs::write(path, vec![0; 1 << 20]);
    if path.exists() {
        std::fs::remove_file(path)?;
    }
    written
}
