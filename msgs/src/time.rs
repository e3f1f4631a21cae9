//! Stamps and durations as numbers.

use crate::builtin_interfaces::msg::{Duration, Time};

/// Nanoseconds in a second.
const NANOS_PER_SECOND: i64 = 1_000_000_000;

/// Whole seconds and the nanoseconds above them; seconds beyond 32 bits saturate.
fn split(nanoseconds: i64) -> (i32, u32) {
    let seconds = nanoseconds.div_euclid(NANOS_PER_SECOND);
    match i32::try_from(seconds) {
        Ok(seconds) => (seconds, nanoseconds.rem_euclid(NANOS_PER_SECOND) as u32),
        Err(_) if seconds < 0 => (i32::MIN, 0),
        Err(_) => (i32::MAX, NANOS_PER_SECOND as u32 - 1),
    }
}

/// Seconds as whole nanoseconds; too large values saturate, and NaN is 0. The product of a
/// present-day stamp and a billion would lose 100 ns, so whole seconds are converted apart.
fn nanoseconds_from_seconds(seconds: f64) -> i64 {
    let whole = seconds.floor();
    let rest = ((seconds - whole) * NANOS_PER_SECOND as f64).round() as i64;
    (whole as i64).saturating_mul(NANOS_PER_SECOND).saturating_add(rest)
}

impl Time {
    /// The time of a number of nanoseconds since the epoch; saturates at what 32 bits of seconds
    /// hold.
    pub fn from_nanoseconds(nanoseconds: i64) -> Self {
        let (sec, nanosec) = split(nanoseconds);
        Time { sec, nanosec }
    }

    /// Number of nanoseconds since the epoch.
    pub fn nanoseconds(&self) -> i64 {
        i64::from(self.sec) * NANOS_PER_SECOND + i64::from(self.nanosec)
    }

    /// The time of a number of seconds since the epoch; saturates.
    pub fn from_seconds(seconds: f64) -> Self {
        Time::from_nanoseconds(nanoseconds_from_seconds(seconds))
    }

    /// Number of seconds since the epoch.
    pub fn seconds(&self) -> f64 {
        f64::from(self.sec) + f64::from(self.nanosec) / NANOS_PER_SECOND as f64
    }
}

impl Duration {
    /// The duration of a number of nanoseconds; saturates at what 32 bits of seconds hold.
    pub fn from_nanoseconds(nanoseconds: i64) -> Self {
        let (sec, nanosec) = split(nanoseconds);
        Duration { sec, nanosec }
    }

    /// Number of nanoseconds.
    pub fn nanoseconds(&self) -> i64 {
        i64::from(self.sec) * NANOS_PER_SECOND + i64::from(self.nanosec)
    }

    /// The duration of a number of seconds; saturates.
    pub fn from_seconds(seconds: f64) -> Self {
        Duration::from_nanoseconds(nanoseconds_from_seconds(seconds))
    }

    /// Number of seconds.
    pub fn seconds(&self) -> f64 {
        f64::from(self.sec) + f64::from(self.nanosec) / NANOS_PER_SECOND as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_and_nanoseconds_are_the_same_both_ways() {
        for nanoseconds in [
            0,
            1,
            999_999_999,
            NANOS_PER_SECOND,
            1_764_028_800 * NANOS_PER_SECOND + 5,
            -1,
            -NANOS_PER_SECOND - 7,
        ] {
            assert_eq!(Time::from_nanoseconds(nanoseconds).nanoseconds(), nanoseconds);
            assert_eq!(Duration::from_nanoseconds(nanoseconds).nanoseconds(), nanoseconds);
        }
        assert_eq!(Time::from_nanoseconds(-1), Time { sec: -1, nanosec: 999_999_999 });
    }

    #[test]
    fn what_does_not_fit_is_cut_off_at_the_limit() {
        assert_eq!(Time::from_nanoseconds(i64::MAX), Time { sec: i32::MAX, nanosec: 999_999_999 });
        assert_eq!(Duration::from_seconds(-1e12), Duration { sec: i32::MIN, nanosec: 0 });
        assert_eq!(Duration::from_seconds(f64::NAN), Duration::default());
    }

    #[test]
    fn seconds_keep_microseconds() {
        let stamp = Time::from_seconds(1_764_028_800.25);
        assert_eq!(stamp, Time { sec: 1_764_028_800, nanosec: 250_000_000 });
        assert_eq!(Duration::from_seconds(-0.5), Duration { sec: -1, nanosec: 500_000_000 });
        assert_eq!(Duration::from_seconds(-0.5).seconds(), -0.5);
    }
}
