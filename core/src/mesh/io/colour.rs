//! Colours for the confidence of a mesh.

/// Smallest scale, metres: keeps the colours defined where every sigma is zero.
const LEAST_SCALE: f64 = 1e-6;

/// The colour of a standard deviation `sigma` (metres): green at 0, yellow at half of `scale` (metres), red
/// from `scale` on and where nothing was measured (NaN). sRGB.
pub fn confidence_colour(sigma: f64, scale: f64) -> [u8; 3] {
    let t = if sigma.is_nan() { 1.0 } else { (sigma / scale).clamp(0.0, 1.0) };
    let channel = |value: f64| (40.0 + 180.0 * value.clamp(0.0, 1.0)).round() as u8;
    [channel(2.0 * t), channel(2.0 - 2.0 * t), 40]
}

/// The scale for [`confidence_colour`]: three times the median of the finite `sigma` (so that half of the
/// surface is greener than the lower third of the range), at least a micrometre. Metres.
pub fn confidence_scale(sigma: &[f64]) -> f64 {
    let mut finite: Vec<f64> = sigma.iter().copied().filter(|s| s.is_finite()).collect();
    if finite.is_empty() {
        return LEAST_SCALE;
    }
    let middle = finite.len() / 2;
    let (_, median, _) = finite.select_nth_unstable_by(middle, f64::total_cmp);
    (3.0 * *median).max(LEAST_SCALE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn certain_is_green_uncertain_and_unmeasured_are_red() {
        let scale = confidence_scale(&[1e-4, 2e-4, f64::NAN, 9e-4]);
        assert!((scale - 6e-4).abs() < 1e-12);
        assert_eq!(confidence_colour(0.0, scale), [40, 220, 40]);
        assert_eq!(confidence_colour(scale / 2.0, scale), [220, 220, 40]);
        assert_eq!(confidence_colour(scale, scale), [220, 40, 40]);
        assert_eq!(confidence_colour(f64::NAN, scale), [220, 40, 40]);
        assert_eq!(confidence_colour(0.0, confidence_scale(&[])), [40, 220, 40]);
    }
}
