//! Points in time.

use puffer_msgs::builtin_interfaces::msg::Time;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// A point in time: nanoseconds since 1970, or since the start of a simulation. It converts from
/// and to `builtin_interfaces/msg/Time`.
///
/// ```
/// use puffer_msgs::builtin_interfaces::msg::Time;
/// use puffer_ros::Stamp;
/// use std::time::Duration;
///
/// let stamp = Stamp::from(Time { sec: 12, nanosec: 500_000_000 });
/// assert_eq!(stamp, Stamp::from_seconds(12.5));
/// let later = stamp + Duration::from_millis(250);
/// assert_eq!(later.seconds_since(stamp), 0.25);
/// assert_eq!(Time::from(later), Time { sec: 12, nanosec: 750_000_000 });
/// assert_eq!(later.to_string(), "12.750000000");
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Stamp(i64);

impl Stamp {
    /// The stamp of nanosecond 0, which ROS messages use for "no stamp".
    pub const ZERO: Stamp = Stamp(0);

    /// The stamp of a number of nanoseconds.
    pub const fn from_nanos(nanos: i64) -> Self {
        Self(nanos)
    }

    /// The stamp of the two fields of a `builtin_interfaces/msg/Time`: seconds and nanoseconds.
    pub const fn new(sec: i32, nanosec: u32) -> Self {
        Self(sec as i64 * 1_000_000_000 + nanosec as i64)
    }

    /// The stamp of a number of seconds; saturates where the nanoseconds do not fit 64 bits.
    pub fn from_seconds(seconds: f64) -> Self {
        Self((seconds * 1e9).round() as i64)
    }

    /// The time of the system's clock.
    pub fn wall() -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self(i64::try_from(since.as_nanos()).unwrap_or(i64::MAX))
    }

    /// Number of nanoseconds.
    pub const fn nanos(self) -> i64 {
        self.0
    }

    /// Number of seconds; exact to about 0.2 microseconds for today's wall time.
    pub fn seconds(self) -> f64 {
        self.0 as f64 * 1e-9
    }

    /// The two fields of a `builtin_interfaces/msg/Time`, seconds and nanoseconds; saturates
    /// outside of what 32 bits of seconds hold.
    pub fn to_sec_nanosec(self) -> (i32, u32) {
        let seconds = self.0.div_euclid(1_000_000_000);
        let nanos = self.0.rem_euclid(1_000_000_000) as u32;
        match i32::try_from(seconds) {
            Ok(seconds) => (seconds, nanos),
            Err(_) if seconds < 0 => (i32::MIN, 0),
            Err(_) => (i32::MAX, 999_999_999),
        }
    }

    /// Number of seconds from `earlier` to this stamp; negative if `earlier` is later.
    pub fn seconds_since(self, earlier: Stamp) -> f64 {
        self.0.saturating_sub(earlier.0) as f64 * 1e-9
    }
}

impl std::ops::Add<Duration> for Stamp {
    type Output = Stamp;
    fn add(self, duration: Duration) -> Stamp {
        Stamp(self.0.saturating_add(i64::try_from(duration.as_nanos()).unwrap_or(i64::MAX)))
    }
}

impl std::ops::Sub<Duration> for Stamp {
    type Output = Stamp;
    fn sub(self, duration: Duration) -> Stamp {
        Stamp(self.0.saturating_sub(i64::try_from(duration.as_nanos()).unwrap_or(i64::MAX)))
    }
}

impl From<Time> for Stamp {
    fn from(time: Time) -> Stamp {
        Stamp::new(time.sec, time.nanosec)
    }
}

impl From<Stamp> for Time {
    fn from(stamp: Stamp) -> Time {
        let (sec, nanosec) = stamp.to_sec_nanosec();
        Time { sec, nanosec }
    }
}

impl std::fmt::Display for Stamp {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (sec, nanosec) = self.to_sec_nanosec();
        write!(f, "{sec}.{nanosec:09}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_and_times_saturate_at_their_limits() {
        let last = Stamp::from_nanos(i64::MAX);
        assert_eq!(last + Duration::from_secs(1), last);
        assert_eq!(Stamp::ZERO - Duration::from_nanos(1), Stamp::from_nanos(-1));
        assert_eq!(Stamp::ZERO - Duration::MAX, Stamp::from_nanos(-i64::MAX));
        assert_eq!(Stamp::from_seconds(1e12), last);
        assert_eq!(Stamp::from_nanos(i64::MIN).to_sec_nanosec(), (i32::MIN, 0));
        let time = Time::from(last);
        assert_eq!((time.sec, time.nanosec), (i32::MAX, 999_999_999));
    }

    #[test]
    fn seconds_between_stamps_have_a_sign() {
        let [early, late] = [1.25, 3.0].map(Stamp::from_seconds);
        assert_eq!(late.seconds_since(early), 1.75);
        assert_eq!(early.seconds_since(late), -1.75);
        assert!(early < late && Stamp::from(Time::from(late)) == late);
    }

    #[test]
    fn a_stamp_keeps_its_nanoseconds_in_both_directions() {
        for nanos in [0, 1, 999_999_999, 1_769_000_123_456_789_012, -1, -1_500_000_000] {
            let stamp = Stamp::from_nanos(nanos);
            let (sec, nanosec) = stamp.to_sec_nanosec();
            assert_eq!(Stamp::new(sec, nanosec), stamp);
        }
        assert_eq!(Stamp::from_nanos(-1_500_000_000).to_sec_nanosec(), (-2, 500_000_000));
        assert_eq!(Stamp::from_nanos(i64::MAX).to_sec_nanosec(), (i32::MAX, 999_999_999));
        assert_eq!(Stamp::from_nanos(1_500_000_000).to_string(), "1.500000000");
    }
}
