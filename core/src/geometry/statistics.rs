//! The median, and the constants of robust statistics.

/// Factor from the median absolute deviation of normally distributed values to their standard
/// deviation.
pub(crate) const MAD_TO_SIGMA: f64 = 1.4826;

/// Residual in standard deviations beyond which Tukey's biweight is zero. It keeps 95 % of the
/// efficiency of least squares under Gaussian noise (Huber & Ronchetti 2009, Robust Statistics,
/// §7.8).
pub(crate) const TUKEY_CUTOFF_SIGMA: f64 = 4.685;

/// The median, of an even number of values the upper one of the two in the middle; `None` if there
/// are no values.
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    if values.is_empty() {
        return None;
    }
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_the_middle_one_or_the_upper_of_two() {
        assert_eq!(median(vec![3.0, -1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![4.0, 1.0, 3.0, 2.0]), Some(3.0));
        assert_eq!(median(Vec::new()), None);
    }

    #[test]
    fn the_median_deviation_of_normal_quantiles_gives_their_sigma() {
        // Half of the standard normal distribution lies within 0.674490.
        assert!((MAD_TO_SIGMA * 0.674_490 - 1.0).abs() < 1e-4);
    }
}
