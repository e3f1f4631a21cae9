//! The time that a scan takes which comes after many others.

use super::case::RegistrationCase;
use super::outcome::{PreparedScans, robot_poses};
use puffer_core::assess::quantile;
use puffer_core::register::{RegisterParams, Registrar};
use puffer_core::simulate::SimulatedScans;
use serde_json::{Value, json};
use std::time::Instant;

/// Numbers (from 1) of the last scans of the spans in the table.
const SPAN_ENDS: [usize; 4] = [2, 10, 26, 100];

/// Milliseconds to align each scan after the first and to add it to the map.
pub(super) struct InsertionTimes {
    milliseconds: Vec<f64>,
}

/// Successive scans, with the median of their times.
#[derive(Debug, PartialEq)]
struct Span {
    /// Number of the first scan, from 1.
    first: usize,
    last: usize,
    /// Milliseconds.
    median: f64,
}

impl InsertionTimes {
    /// Adds the scans to a registrar one by one.
    pub(super) fn measure(
        scans: &SimulatedScans,
        prepared: &PreparedScans,
        params: &RegisterParams,
    ) -> InsertionTimes {
        let mut registrar = Registrar::new(scans.pose_sigma, params.clone());
        let mut milliseconds = Vec::new();
        for (scan, pose) in prepared.scans.iter().zip(robot_poses(scans)) {
            let started = Instant::now();
            registrar.add(scan, &pose);
            milliseconds.push(started.elapsed().as_secs_f64() * 1e3);
        }
        // The first scan is aligned to nothing.
        milliseconds.drain(..1.min(milliseconds.len()));
        InsertionTimes { milliseconds }
    }

    /// The spans that the scans reach.
    fn spans(&self) -> Vec<Span> {
        let count = self.milliseconds.len() + 1;
        let mut first = 2;
        let mut spans = Vec::new();
        for end in SPAN_ENDS {
            let last = end.min(count);
            if last >= first {
                let times = &self.milliseconds[first - 2..last - 1];
                spans.push(Span { first, last, median: quantile(times, 0.5) });
            }
            first = end + 1;
        }
        spans
    }

    pub(super) fn table(&self, case: &RegistrationCase) -> String {
        let mut text = format!("{}: median time to align and add a scan\n", case.name());
        for Span { first, last, median } in self.spans() {
            text += &format!("  scans {first:>3} to {last:>3}  {median:>8.1} ms\n");
        }
        text
    }

    pub(super) fn json(&self, case: &RegistrationCase) -> Value {
        json!({
            "object": case.object, "noise": format!("{:?}", case.family), "seed": case.seed,
            "add_milliseconds": self.milliseconds,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_end_where_the_scans_do() {
        let times = InsertionTimes { milliseconds: (2..=12).map(f64::from).collect() };
        assert_eq!(
            times.spans(),
            [
                Span { first: 2, last: 2, median: 2.0 },
                Span { first: 3, last: 10, median: 6.5 },
                Span { first: 11, last: 12, median: 11.5 },
            ]
        );
        assert!(InsertionTimes { milliseconds: Vec::new() }.spans().is_empty());
    }
}
