//! Recovery of known poses on scans of a real sensor: how many scans that are moved away from their
//! poses come back to them.

use anyhow::{Context, Result};
use puffer::table::print_text;
use puffer_core::Progress;
use puffer_core::assess::{RecoveredPose, RecoveryTest};
use puffer_core::register::RegisterParams;
use puffer_core::scan_files::{Unit, read_scans};
use std::path::Path;

/// Sizes of the perturbations: angle in degrees and distance in mm.
const PERTURBATIONS: [(f64, f64); 2] = [(5.0, 5.0), (10.0, 10.0)];
/// Largest angle from the reference at which a scan counts as recovered.
const MAX_RECOVERED_DEGREES: f64 = 0.5;
/// Largest distance from the reference at which a scan counts as recovered.
const MAX_RECOVERED_MM: f64 = 0.5;

/// Counts of what became of perturbed scans.
#[derive(Default)]
struct RecoveryCounts {
    recovered: usize,
    /// Accepted at another pose than the reference.
    wrong: usize,
    refused: usize,
    /// Largest differences of accepted scans.
    worst_degrees: f64,
    worst_millimetres: f64,
}

/// Perturbs the scans of `input`, once for each seed and size, registers them and prints how many
/// recover their poses.
pub(super) fn run(input: &Path, seeds: &[u64], params: &RegisterParams) -> Result<()> {
    let set = read_scans(input, Unit::Metre).with_context(|| input.display().to_string())?;
    let reference = RecoveryTest::new(&set)?;
    for (degrees, millimetres) in PERTURBATIONS {
        let mut counts = RecoveryCounts::default();
        for &seed in seeds {
            let (angle, distance) = (degrees.to_radians(), millimetres * 1e-3);
            let progress = Progress::silent();
            let recovered =
                reference.perturb_and_register(angle, distance, seed, params, &progress)?;
            for (scan, pose) in recovered.iter().enumerate() {
                counts.add(seed, scan, pose);
            }
        }
        print_text(&format!(
            "{degrees} degrees, {millimetres} mm: back within {MAX_RECOVERED_DEGREES} degrees and {MAX_RECOVERED_MM} mm \
             {} of {}, refused {}, wrong {}; worst accepted {:.2} degrees, {:.2} mm\n",
            counts.recovered,
            counts.recovered + counts.wrong + counts.refused,
            counts.refused,
            counts.wrong,
            counts.worst_degrees,
            counts.worst_millimetres
        ));
    }
    Ok(())
}

impl RecoveryCounts {
    /// Counts one scan; prints a line if it did not recover.
    fn add(&mut self, seed: u64, scan: usize, pose: &RecoveredPose) {
        let degrees = pose.difference.angle.to_degrees();
        let millimetres = pose.difference.distance * 1e3;
        if !pose.accepted {
            self.refused += 1;
            print_text(&format!("  seed {seed}, scan {scan}: refused: {}\n", pose.reason));
            return;
        }
        if degrees < MAX_RECOVERED_DEGREES && millimetres < MAX_RECOVERED_MM {
            self.recovered += 1;
        } else {
            self.wrong += 1;
            print_text(&format!(
                "  seed {seed}, scan {scan}: off by {degrees:.2} degrees, {millimetres:.2} mm\n"
            ));
        }
        self.worst_degrees = self.worst_degrees.max(degrees);
        self.worst_millimetres = self.worst_millimetres.max(millimetres);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_core::assess::PoseDifference;

    #[test]
    fn scans_are_counted_as_recovered_wrong_or_refused() {
        let mut counts = RecoveryCounts::default();
        for (degrees, millimetres, accepted) in
            [(0.4_f64, 0.4, true), (0.6, 0.1, true), (0.1, 0.7, true), (9.0, 9.0, false)]
        {
            let difference =
                PoseDifference { angle: degrees.to_radians(), distance: millimetres * 1e-3 };
            counts.add(1, 0, &RecoveredPose { difference, accepted, reason: String::new() });
        }
        assert_eq!((counts.recovered, counts.wrong, counts.refused), (1, 2, 1));
        assert!((counts.worst_degrees - 0.6).abs() < 1e-12, "refused scans do not count");
        assert!((counts.worst_millimetres - 0.7).abs() < 1e-12);
    }
}
