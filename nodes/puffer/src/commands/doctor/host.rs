//! Checks of the machine itself.

use super::check::Check;
use std::path::Path;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Enough for a few million points.
const MIN_MEMORY_GB: f64 = 2.0;
/// 2025-01-01, seconds since 1970: before this program was written.
const EARLIEST_UNIX_TIME: u64 = 1_735_689_600;
/// How long the clock is watched, and how far it may jump meanwhile.
const CLOCK_WATCH_TIME: Duration = Duration::from_millis(100);
const MAX_CLOCK_JUMP_S: f64 = 0.02;

pub(super) fn checks() -> Vec<Check> {
    vec![check_cores(), check_memory(), check_temporary_files(), check_clock()]
}

fn check_cores() -> Check {
    let cores = std::thread::available_parallelism().map_or(0, std::num::NonZero::get);
    let mend = "check the process's CPU affinity (taskset -p $$)";
    Check::new("processor cores", cores >= 1, cores.to_string(), mend)
}

fn check_memory() -> Check {
    let text = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let gigabytes = text
        .lines()
        .find(|line| line.starts_with("MemAvailable:"))
        .and_then(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok())
        .map(|kilobytes| kilobytes * 1024.0 / 1e9);
    Check::new(
        "free memory",
        gigabytes.is_none_or(|gb| gb >= MIN_MEMORY_GB),
        gigabytes.map_or_else(|| "unknown".into(), |gb| format!("{gb:.1} GB")),
        "close other programs; 2 GB hold a few million points",
    )
}

fn check_temporary_files() -> Check {
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

/// Seconds since 1970 by the system's clock.
fn unix_time() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |time| time.as_secs_f64())
}

/// Transforms and scans meet by their stamps: the clock has to be right, and steady.
fn check_clock() -> Check {
    let mend = "sudo timedatectl set-ntp true, on every machine of the robot";
    let (steady, before) = (Instant::now(), unix_time());
    std::thread::sleep(CLOCK_WATCH_TIME);
    let jump = unix_time() - before - steady.elapsed().as_secs_f64();
    let found = match (before as u64 >= EARLIEST_UNIX_TIME, jump.abs() <= MAX_CLOCK_JUMP_S) {
        (false, _) => format!("stands at {before:.0} s since 1970, which is long past"),
        (true, false) => format!("jumped by {:.0} ms while it was watched", jump * 1e3),
        (true, true) => "set, and steady".to_owned(),
    };
    Check::new(
        "clock",
        before as u64 >= EARLIEST_UNIX_TIME && jump.abs() <= MAX_CLOCK_JUMP_S,
        found,
        mend,
    )
}
