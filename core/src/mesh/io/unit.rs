//! The unit of a file's coordinates, and a check that detects a wrong one.

/// Metres in a millimetre.
const METRES_PER_MILLIMETRE: f64 = 1e-3;
/// Largest extent that is plausible in metres.
const MAX_EXTENT_M: f64 = 10.0;
/// Smallest extent that is plausible for coordinates that the user declares to be millimetres.
const MIN_EXTENT_M: f64 = 1e-3;
/// Share of the points that is left out at either end, so that few far outliers do not look like a
/// wrong unit.
const TRIM_RATIO: f64 = 0.01;
/// Limit of the points that are examined: enough for the share above.
const MAX_SAMPLES: usize = 20_000;

/// The unit of a file's lengths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unit {
    /// Metres.
    #[default]
    Metre,
    /// Millimetres.
    Millimetre,
}

impl Unit {
    /// Metres in one unit.
    pub fn metres_per_unit(self) -> f64 {
        match self {
            Unit::Metre => 1.0,
            Unit::Millimetre => METRES_PER_MILLIMETRE,
        }
    }
}

/// The largest extent along an axis, between the 1st and the 99th percentile of the finite points.
pub(crate) fn trimmed_extent(points: impl ExactSizeIterator<Item = [f64; 3]>) -> f64 {
    let step = points.len().div_ceil(MAX_SAMPLES).max(1);
    let sample: Vec<[f64; 3]> =
        points.step_by(step).filter(|p| p.iter().all(|v| v.is_finite())).collect();
    if sample.is_empty() {
        return 0.0;
    }
    (0..3).map(|axis| trimmed_range(sample.iter().map(|p| p[axis]).collect())).fold(0.0, f64::max)
}

/// The range of the values without the smallest and the largest ones.
fn trimmed_range(mut values: Vec<f64>) -> f64 {
    let trim = (TRIM_RATIO * values.len() as f64) as usize;
    let last = values.len() - 1 - trim;
    let high = *values.select_nth_unstable_by(last, f64::total_cmp).1;
    let low = *values.select_nth_unstable_by(trim, f64::total_cmp).1;
    high - low
}

/// Returns an error message for coordinates that must be in another unit; `extent` is in metres
/// after the conversion from `unit`.
pub(crate) fn check_extent(extent: f64, unit: Unit) -> std::result::Result<(), String> {
    match unit {
        Unit::Metre if extent > MAX_EXTENT_M => Err(format!(
            "its coordinates span {extent:.4} m, more than {MAX_EXTENT_M} m: millimetres? use --unit mm"
        )),
        Unit::Millimetre if extent > MAX_EXTENT_M => {
            Err(format!("its coordinates span {extent:.4} m even as millimetres: check its unit"))
        }
        Unit::Millimetre if extent < MIN_EXTENT_M => Err(format!(
            "its coordinates span only {:.4} mm if they are millimetres: metres? leave out --unit mm",
            extent * 1e3
        )),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points along x over this length.
    fn line(length: f64) -> impl ExactSizeIterator<Item = [f64; 3]> {
        (0..1000u16).map(move |i| [f64::from(i) / 999.0 * length, 0.0, 0.0])
    }

    #[test]
    fn a_wrong_unit_is_told_and_outliers_are_not_taken_for_one() {
        assert!(check_extent(trimmed_extent(line(0.2)), Unit::Metre).is_ok());
        let millimetres = check_extent(trimmed_extent(line(200.0)), Unit::Metre).unwrap_err();
        assert!(millimetres.contains("millimetres? use --unit mm"), "{millimetres}");
        let metres = check_extent(trimmed_extent(line(0.2e-3)), Unit::Millimetre).unwrap_err();
        assert!(metres.contains("leave out --unit mm"), "{metres}");
        let mut points: Vec<[f64; 3]> = line(0.2).collect();
        points[7] = [50.0, 0.0, f64::NAN];
        points[8] = [50.0, 0.0, 0.0];
        assert!(trimmed_extent(points.into_iter()) < 0.2);
    }
}
