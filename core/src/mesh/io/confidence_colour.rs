//! Colours that show the standard deviation of a mesh's vertices.

/// Smallest scale: keeps the colours defined if every sigma is zero.
const MIN_SCALE_M: f64 = 1e-6;

/// Lowest level of a channel: no colour is saturated, so that shading stays visible.
const MIN_CHANNEL: f64 = 40.0;
/// Difference between the highest and the lowest level of a channel.
const CHANNEL_RANGE: f64 = 180.0;
/// The scale is this multiple of the median sigma: half of the surface is then greener than the
/// lower third of the range.
const SCALE_MEDIANS: f64 = 3.0;

/// The colour (sRGB) of a standard deviation `sigma` (metres): green at 0, yellow at half of
/// `scale` (metres), red from `scale` on and if nothing was measured (NaN).
pub fn confidence_colour(sigma: f64, scale: f64) -> [u8; 3] {
    let t = if sigma.is_nan() { 1.0 } else { (sigma / scale).clamp(0.0, 1.0) };
    [channel_level(2.0 * t), channel_level(2.0 - 2.0 * t), channel_level(0.0)]
}

/// The level of a channel: the lowest one at 0, the highest one from 1 on.
fn channel_level(value: f64) -> u8 {
    (MIN_CHANNEL + CHANNEL_RANGE * value.clamp(0.0, 1.0)).round() as u8
}

/// The scale for [`confidence_colour`], metres: three times the median of the finite `sigma`, at
/// least a micrometre.
pub fn confidence_scale(sigma: &[f64]) -> f64 {
    let mut finite: Vec<f64> = sigma.iter().copied().filter(|s| s.is_finite()).collect();
    if finite.is_empty() {
        return MIN_SCALE_M;
    }
    let middle = finite.len() / 2;
    let (_, median, _) = finite.select_nth_unstable_by(middle, f64::total_cmp);
    (SCALE_MEDIANS * *median).max(MIN_SCALE_M)
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
