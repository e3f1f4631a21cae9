//! The samples that a reader received.

use serde_json::Value;

/// The samples that one reader received.
#[derive(Default)]
pub(super) struct ReceivedSamples {
    /// Numbers of the correct samples, in the order of arrival.
    pub indices: Vec<u64>,
    /// Samples that were damaged or repeated.
    pub corrupt: u64,
    /// Tiles that the transport rejected by their checksum.
    pub rejected: u64,
    /// Times of arrival, seconds of the system's clock.
    pub times: Vec<f64>,
}

impl ReceivedSamples {
    /// Adds the event if it reports a sample.
    pub(super) fn add_event(&mut self, event: &Value) {
        if event["event"] != "sample" {
            return;
        }
        match event["index"].as_u64() {
            Some(index) if !self.indices.contains(&index) => self.indices.push(index),
            _ => self.corrupt += 1,
        }
        self.rejected = event["rejected"].as_u64().unwrap_or(0);
        self.times.push(event["at"].as_f64().unwrap_or(f64::NAN));
    }

    /// Longest time between two samples, or before the first one, seconds.
    pub(super) fn longest_gap(&self, started: f64) -> f64 {
        let before = std::iter::once(&started).chain(&self.times);
        before.zip(&self.times).map(|(a, b)| b - a).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn repeated_and_broken_samples_count_as_corrupt() {
        let mut received = ReceivedSamples::default();
        for (index, at) in [(json!(0), 1.0), (json!(1), 1.5), (json!(1), 4.0), (Value::Null, 4.5)] {
            received
                .add_event(&json!({"event": "sample", "index": index, "at": at, "rejected": 3}));
        }
        received.add_event(&json!({"event": "ready"}));
        assert_eq!((received.indices.as_slice(), received.corrupt), (&[0, 1][..], 2));
        assert_eq!((received.rejected, received.times.len()), (3, 4));
        assert_eq!(received.longest_gap(0.75), 2.5);
        assert_eq!(received.longest_gap(-9.0), 10.0, "the time before the first sample counts");
    }
}
