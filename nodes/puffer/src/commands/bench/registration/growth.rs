//! How long a scan takes that comes after many others.

use super::Case;
use super::found::{Prepared, reported};
use puffer_core::assess::quantile;
use puffer_core::register::{RegisterParams, Registrar};
use puffer_core::simulate::SimulatedScans;
use serde_json::{Value, json};
use std::time::Instant;

/// Numbers of the scans (from 1) that end a span.
const ENDS: [usize; 4] = [2, 10, 26, 100];

/// Milliseconds that each scan after the first took: to align it and to add it to the map.
pub(super) struct Growth {
    milliseconds: Vec<f64>,
}

/// Gives the scans to a registrar one by one.
pub(super) fn measure(
    scans: &SimulatedScans,
    prepared: &Prepared,
    params: &RegisterParams,
) -> Growth {
    let mut registrar = Registrar::new(scans.pose_sigma, params.clone());
    let mut milliseconds = Vec::new();
    for (scan, pose) in prepared.scans.iter().zip(reported(scans)) {
        let started = Instant::now();
        registrar.add(scan, &pose);
        milliseconds.push(started.elapsed().as_secs_f64() * 1e3);
    }
    // The first scan is aligned to nothing.
    milliseconds.drain(..1.min(milliseconds.len()));
    Growth { milliseconds }
}

impl Growth {
    /// First and last scan of each span, and the median of its milliseconds.
    fn spans(&self) -> Vec<(usize, usize, f64)> {
        let count = self.milliseconds.len() + 1;
        let mut first = 2;
        let mut spans = Vec::new();
        for end in ENDS {
            let last = end.min(count);
            if last >= first {
                let times = &self.milliseconds[first - 2..last - 1];
                spans.push((first, last, quantile(times, 0.5)));
            }
            first = end + 1;
        }
        spans
    }

    pub(super) fn table(&self, case: &Case) -> String {
        let span = |(first, last, time): (usize, usize, f64)| {
            format!("  scans {first:>3} to {last:>3}  {time:>8.1} ms\n")
        };
        format!("{}: median time to align and add a scan\n", case.name())
            + &self.spans().into_iter().map(span).collect::<String>()
    }

    pub(super) fn json(&self, case: &Case) -> Value {
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
        let growth = Growth { milliseconds: (2..=12).map(f64::from).collect() };
        assert_eq!(growth.spans(), [(2, 2, 2.0), (3, 10, 6.5), (11, 12, 11.5)]);
        assert!(Growth { milliseconds: Vec::new() }.spans().is_empty());
    }
}
