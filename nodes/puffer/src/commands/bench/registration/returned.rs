//! Whether a real sensor's scans come back to the poses that they had.

use crate::table::print_text;
use anyhow::{Context, Result};
use puffer_core::Progress;
use puffer_core::assess::{PosedReference, Returned};
use puffer_core::register::RegisterParams;
use puffer_core::scans::{Unit, read_scans};
use std::path::Path;

/// What the scans are moved off by: degrees and mm.
const OFF: [(f64, f64); 2] = [(5.0, 5.0), (10.0, 10.0)];
/// A scan within this of its reference is back: degrees and mm.
const BACK: (f64, f64) = (0.5, 0.5);

/// Moves the scans of `input` off their poses, once a seed and size, and prints how many come back.
pub(super) fn run(input: &Path, seeds: &[u64], params: &RegisterParams) -> Result<()> {
    let set = read_scans(input, Unit::M).with_context(|| input.display().to_string())?;
    let reference = PosedReference::new(&set)?;
    for (degrees, millimetres) in OFF {
        let (mut back, mut wrong, mut refused) = (0, 0, 0);
        let mut worst = (0.0_f64, 0.0_f64);
        for &seed in seeds {
            let progress = Progress::silent();
            let (angle, distance) = (degrees.to_radians(), millimetres * 1e-3);
            for (scan, found) in
                reference.attempt(angle, distance, seed, params, &progress)?.iter().enumerate()
            {
                let off = difference(found);
                if !found.accepted {
                    refused += 1;
                    print_text(&format!("  seed {seed}, scan {scan}: refused: {}\n", found.reason));
                } else if off.0 < BACK.0 && off.1 < BACK.1 {
                    back += 1;
                } else {
                    wrong += 1;
                    let (angle, distance) = off;
                    print_text(&format!(
                        "  seed {seed}, scan {scan}: off by {angle:.2} degrees, {distance:.2} mm\n"
                    ));
                }
                if found.accepted {
                    worst = (worst.0.max(off.0), worst.1.max(off.1));
                }
            }
        }
        print_text(&format!(
            "{degrees} degrees, {millimetres} mm: back within {} degrees and {} mm {back} of {}, refused {refused}, \
             wrong {wrong}; worst accepted {:.2} degrees, {:.2} mm\n",
            BACK.0,
            BACK.1,
            back + wrong + refused,
            worst.0,
            worst.1
        ));
    }
    Ok(())
}

fn difference(found: &Returned) -> (f64, f64) {
    (found.difference.0.to_degrees(), found.difference.1 * 1e3)
}
