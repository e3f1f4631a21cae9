//! Local plane fits.

use super::{Mat3, Vec3};

/// Least ratio of the second to the largest variance: points within a millionth of their extent lie
/// on a line.
const MIN_WIDTH_RATIO_SQUARED: f64 = 1e-12;

/// A plane fitted to points.
#[derive(Clone, Copy, Debug)]
pub struct PlaneFit {
    /// (Weighted) mean of the points, metres.
    pub center: Vec3,
    /// Unit normal, of arbitrary sign.
    pub normal: Vec3,
    /// Variances along the principal axes, ascending, square metres; the first is along the normal.
    pub variances: [f64; 3],
}

/// Weighted total-least-squares plane through `points` (pairs of point and weight); `None` with
/// fewer than three points or when they lie on one line.
pub fn fit_plane(points: impl Iterator<Item = (Vec3, f64)> + Clone) -> Option<PlaneFit> {
    let (mut total, mut sum, mut count) = (0.0, Vec3::zeros(), 0);
    for (point, weight) in points.clone() {
        total += weight;
        sum += point * weight;
        count += 1;
    }
    if count < 3 || total <= 0.0 {
        return None;
    }
    let center = sum / total;
    let mut covariance = Mat3::zeros();
    for (point, weight) in points {
        let offset = point - center;
        covariance += offset * offset.transpose() * weight;
    }
    let eigen = (covariance / total).symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let variances = order.map(|i| eigen.eigenvalues[i].max(0.0));
    // A line has only one direction of extent, and a plane through it is arbitrary.
    if variances[1] <= MIN_WIDTH_RATIO_SQUARED * variances[2] || variances[2] <= 0.0 {
        return None;
    }
    Some(PlaneFit { center, normal: eigen.eigenvectors.column(order[0]).into_owned(), variances })
}

/// Largest x component of a unit vector that is turned about the x axis.
const MAX_ORTHOGONAL_X: f64 = 0.6;

/// Some unit vector orthogonal to the unit vector `axis`.
pub fn any_orthogonal(axis: &Vec3) -> Vec3 {
    // The cross product of nearly parallel vectors would lose digits. A unit vector whose x is
    // beyond 0.6 has a y below 0.8.
    let other = if axis.x.abs() < MAX_ORTHOGONAL_X { Vec3::x() } else { Vec3::y() };
    axis.cross(&other).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_of_a_tilted_plane_is_found() {
        let normal = Vec3::new(1.0, 2.0, 3.0).normalize();
        let (u, v) = (any_orthogonal(&normal), normal.cross(&any_orthogonal(&normal)));
        let points = (0..25).map(move |i| (u * (i % 5) as f64 + v * (i / 5) as f64 * 2.0, 1.0));
        let fit = fit_plane(points).unwrap();
        assert!(fit.normal.dot(&normal).abs() > 1.0 - 1e-12);
        assert!(fit.variances[0] < 1e-12);
    }

    #[test]
    fn a_line_has_no_plane() {
        assert!(fit_plane((0..10).map(|i| (Vec3::new(i as f64, 0.0, 0.0), 1.0))).is_none());
    }
}
