//! Memory of this process, from /proc.

/// Bytes in a megabyte as printed.
pub(super) const MB: f64 = 1e6;

/// Resident now, and at most so far, bytes; 0 where the system does not tell.
pub(super) fn resident() -> (u64, u64) {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let field = |name: &str| {
        text.lines()
            .find_map(|line| line.strip_prefix(name))
            .and_then(|rest| rest.split_whitespace().next()?.parse::<u64>().ok())
            .map_or(0, |kilobytes| kilobytes * 1024)
    };
    (field("VmRSS:"), field("VmHWM:"))
}
