//! The unit of a file's coordinates, and the check that catches the wrong one.

/// Largest extent that is believed to be metres.
const LARGEST: f64 = 10.0;
/// Smallest extent that is believed to be millimetres once the user said so, metres.
const SMALLEST: f64 = 1e-3;
/// Share of the points left out at either end, so that single far outliers do not look like a wrong unit.
const TRIM: f64 = 0.01;
/// Points looked at: enough for the share above.
const SAMPLES: usize = 20_000;

/// The unit of a file's lengths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unit {
    /// Metres.
    #[default]
    M,
    /// Millimetres.
    Mm,
}

impl Unit {
    /// Metres in one unit.
    pub fn metres(self) -> f64 {
        match self {
            Unit::M => 1.0,
            Unit::Mm => 1e-3,
        }
    }
}

/// The largest extent along an axis, between the 1st and the 99th percentile of the finite points.
pub(crate) fn largest_extent(points: impl ExactSizeIterator<Item = [f64; 3]>) -> f64 {
    let step = points.len().div_ceil(SAMPLES).max(1);
    let sample: Vec<[f64; 3]> =
        points.step_by(step).filter(|p| p.iter().all(|v| v.is_finite())).collect();
    let extent = |axis: usize| {
        let mut values: Vec<f64> = sample.iter().map(|p| p[axis]).collect();
        let trim = (TRIM * values.len() as f64) as usize;
        let mut at = |index: usize| *values.select_nth_unstable_by(index, f64::total_cmp).1;
        at(sample.len() - 1 - trim) - at(trim)
    };
    if sample.is_empty() { 0.0 } else { (0..3).map(extent).fold(0.0, f64::max) }
}

/// Refuses coordinates that must be in another unit; `extent` is in metres after the conversion from `unit`.
pub(crate) fn check_extent(extent: f64, unit: Unit) -> std::result::Result<(), String> {
    match unit {
        Unit::M if extent > LARGEST => Err(format!(
            "its coordinates span {extent:.4} m, more than {LARGEST} m: millimetres? use --unit mm"
        )),
        Unit::Mm if extent > LARGEST => {
            Err(format!("its coordinates span {extent:.4} m even as millimetres: check its unit"))
        }
        Unit::Mm if extent < SMALLEST => Err(format!(
            "its coordinates span only {:.4} mm if they are millimetres: metres? leave out --unit mm",
            extent * 1e3
        )),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_unit_is_told_and_outliers_are_not_taken_for_one() {
        let line = |length: f64| (0..1000).map(move |i| [f64::from(i) / 999.0 * length, 0.0, 0.0]);
        assert!(check_extent(largest_extent(line(0.2)), Unit::M).is_ok());
        let millimetres = check_extent(largest_extent(line(200.0)), Unit::M).unwrap_err();
        assert!(millimetres.contains("millimetres? use --unit mm"), "{millimetres}");
        let metres = check_extent(largest_extent(line(0.2e-3)), Unit::Mm).unwrap_err();
        assert!(metres.contains("leave out --unit mm"), "{metres}");
        let mut points: Vec<[f64; 3]> = line(0.2).collect();
        points[7] = [50.0, 0.0, f64::NAN];
        points[8] = [50.0, 0.0, 0.0];
        assert!(largest_extent(points.into_iter()) < 0.2);
    }
}
