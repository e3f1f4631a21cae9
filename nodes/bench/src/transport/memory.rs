//! Memory of this process, from /proc.

/// Bytes in a megabyte as printed.
pub(super) const BYTES_PER_MB: f64 = 1e6;

/// Bytes in a KiB, the unit of /proc.
const BYTES_PER_KIB: u64 = 1024;

/// Resident memory of this process, bytes; 0 where the system does not tell it.
pub(super) struct MemoryUse {
    /// Resident now.
    pub resident: u64,
    /// Largest so far.
    pub peak: u64,
}

/// Reads the memory of this process.
pub(super) fn memory_use() -> MemoryUse {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    MemoryUse { resident: status_bytes(&text, "VmRSS:"), peak: status_bytes(&text, "VmHWM:") }
}

/// The value of a field of /proc/self/status, which is in KiB, in bytes.
fn status_bytes(status: &str, field: &str) -> u64 {
    status
        .lines()
        .find_map(|line| line.strip_prefix(field))
        .and_then(|rest| rest.split_whitespace().next()?.parse::<u64>().ok())
        .map_or(0, |kibibytes| kibibytes * BYTES_PER_KIB)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_read_in_bytes_and_missing_ones_are_zero() {
        let status = "Name:\tx\nVmHWM:\t  2048 kB\nVmRSS:\t     12 kB\n";
        assert_eq!(status_bytes(status, "VmHWM:"), 2 * 1024 * 1024);
        assert_eq!(status_bytes(status, "VmRSS:"), 12 * 1024);
        assert_eq!(status_bytes(status, "VmSwap:"), 0);
    }
}
