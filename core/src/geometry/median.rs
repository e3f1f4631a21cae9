//! The median.

/// Factor from the median absolute deviation of normally distributed values to their standard deviation.
pub(crate) const MAD_TO_SIGMA: f64 = 1.4826;

/// Median; `None` of nothing.
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    if values.is_empty() {
        return None;
    }
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}
