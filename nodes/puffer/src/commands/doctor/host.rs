//! Checks of the machine itself.

use super::Check;
use std::path::Path;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Enough for a few million points.
const LEAST_MEMORY_GB: f64 = 2.0;
/// 2025-01-01, seconds since 1970: before this program was written.
const EARLIEST: u64 = 1_735_689_600;
/// How long the clock is watched, and how far it may jump meanwhile.
const WATCH: Duration = Duration::from_millis(100);
const JUMP: f64 = 0.02;

pub(super) fn checks() -> Vec<Check> {
    vec![cores(), memory(), temporary_space(), clock()]
}

fn cores() -> Check {
    let cores = std::thread::available_parallelism().map_or(0, std::num::NonZero::get);
    let mend = "check the process's CPU affinity (taskset -p $$)";
    Check::new("processor cores", cores >= 1, cores.to_string(), mend)
}

fn memory() -> Check {
    let text = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let gigabytes = text
        .lines()
        .find(|line| line.starts_with("MemAvailable:"))
        .and_then(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok())
        .map(|kilobytes| kilobytes * 1024.0 / 1e9);
    Check::new(
        "free memory",
        gigabytes.is_none_or(|gb| gb >= LEAST_MEMORY_GB),
        gigabytes.map_or_else(|| "unknown".into(), |gb| format!("{gb:.1} GB")),
        "close other programs; 2 GB hold a few million points",
    )
}

fn temporary_space() -> Check {
    let folder = std::env::temp_dir();
    let probe = folder.join(format!("puffer-doctor-{}", std::process::id()));
    let outcome = write_probe(&probe);
    let found = match &outcome {
        Ok(()) => format!("{} can be written", folder.display()),
        Err(error) => format!("{}: {error}", folder.display()),
    };
    let mend = "free space there, or set TMPDIR to a folder with space";
    Check::new("temporary files", outcome.is_ok(), found, mend)
}

/// Writes and removes a megabyte.
fn write_probe(path: &Path) -> std::io::Result<()> {
    let written = std::fs::write(path, vec![0; 1 << 20]);
    if path.exists() {
        std::fs::remove_file(path)?;
    }
    written
}

/// Transforms and scans meet by their stamps: the clock has to be right, and steady.
fn clock() -> Check {
    let mend = "sudo timedatectl set-ntp true, on every machine of the robot";
    let seconds = || SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |d| d.as_secs_f64());
    let (steady, before) = (Instant::now(), seconds());
    std::thread::sleep(WATCH);
    let jump = seconds() - before - steady.elapsed().as_secs_f64();
    let found = match (before as u64 >= EARLIEST, jump.abs() <= JUMP) {
        (false, _) => format!("stands at {before:.0} s since 1970, which is long past"),
        (true, false) => format!("jumped by {:.0} ms while it was watched", jump * 1e3),
        (true, true) => "set, and steady".to_owned(),
    };
    Check::new("clock", before as u64 >= EARLIEST && jump.abs() <= JUMP, found, mend)
}
