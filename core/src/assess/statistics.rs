//! Means, quantiles and ranks.

/// Mean; NaN of an empty list.
pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Root mean square; NaN of an empty list.
pub(crate) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// Share of the values for which `holds` is true; NaN of an empty list.
pub(crate) fn share(values: &[f64], holds: impl Fn(f64) -> bool) -> f64 {
    values.iter().filter(|v| holds(**v)).count() as f64 / values.len() as f64
}

/// The quantile of `values` at `fraction` (0 to 1), interpolated linearly between order statistics
/// (type 7 of Hyndman & Fan 1996, Sample Quantiles in Statistical Packages); NaN of an empty list.
pub fn quantile(values: &[f64], fraction: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let position = fraction * last as f64;
    let low = position.floor() as usize;
    let high = (low + 1).min(last);
    sorted[low] + (sorted[high] - sorted[low]) * (position - low as f64)
}

/// Spearman's rank correlation of two lists of equal length, where ties share their mean rank; NaN
/// if either list is constant.
pub(crate) fn rank_correlation(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (ranks(a), ranks(b));
    let (mean_a, mean_b) = (mean(&a), mean(&b));
    let (mut covariance, mut variance_a, mut variance_b) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(&b) {
        let (x, y) = (x - mean_a, y - mean_b);
        covariance += x * y;
        variance_a += x * x;
        variance_b += y * y;
    }
    covariance / (variance_a * variance_b).sqrt()
}

/// The rank of each value, counted from 0; ties share their mean rank.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&i, &j| values[i].total_cmp(&values[j]));
    let mut ranks = vec![0.0; values.len()];
    let mut before = 0;
    for tied in order.chunk_by(|&i, &j| values[i] == values[j]) {
        for &i in tied {
            ranks[i] = before as f64 + (tied.len() as f64 - 1.0) / 2.0;
        }
        before += tied.len();
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_linear_between_order_statistics() {
        assert_eq!(quantile(&[3.0, 1.0, 2.0, 4.0], 0.9), 3.7);
        assert_eq!(quantile(&[5.0], 0.01), 5.0);
        assert!(quantile(&[], 0.5).is_nan());
    }

    #[test]
    fn rank_correlation_sees_order_alone_and_shares_ties() {
        assert_eq!(rank_correlation(&[1.0, 2.0, 9.0], &[0.1, 50.0, 60.0]), 1.0);
        assert_eq!(rank_correlation(&[1.0, 2.0, 9.0], &[3.0, 2.0, 1.0]), -1.0);
        // Ranks 0.5 0.5 2 3 and 0 1 2 3.
        let tied = rank_correlation(&[1.0, 1.0, 2.0, 3.0], &[1.0, 2.0, 3.0, 4.0]);
        assert!((tied - 4.5 / (4.5f64 * 5.0).sqrt()).abs() < 1e-12);
        assert!(rank_correlation(&[1.0, 1.0], &[1.0, 2.0]).is_nan());
    }

    #[test]
    fn mean_rms_and_share_are_those_by_hand() {
        let values = [1.0, -2.0, 3.0, 4.0];
        assert_eq!(mean(&values), 1.5);
        assert_eq!(rms(&values), 7.5f64.sqrt());
        assert_eq!(share(&values, |v| v > 0.0), 0.75);
        assert!(mean(&[]).is_nan() && rms(&[]).is_nan() && share(&[], |_| true).is_nan());
    }

    #[test]
    fn a_rank_is_the_count_of_smaller_values_and_half_of_the_other_equal_ones() {
        let values: Vec<f64> = (0..60).map(|i| f64::from(i * 37 % 23)).collect();
        for (value, rank) in values.iter().zip(ranks(&values)) {
            let smaller = values.iter().filter(|v| *v < value).count() as f64;
            let equal = values.iter().filter(|v| *v == value).count() as f64;
            assert_eq!(rank, smaller + (equal - 1.0) / 2.0);
        }
    }

    #[test]
    fn a_share_of_the_values_lies_below_the_quantile() {
        let values: Vec<f64> = (0..101).map(|i| f64::from(i * 37 % 101)).collect();
        for percent in [0.0, 10.0, 33.0, 50.0, 90.0, 100.0] {
            assert!((quantile(&values, percent / 100.0) - percent).abs() < 1e-12);
        }
    }
}
