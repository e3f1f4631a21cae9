//! The distance between neighbouring points of a scan.

use crate::geometry::{KdTree, Vec3, median};

/// Points sampled to estimate a scan's spacing and noise: enough for a median to 3 %.
pub(super) const MAX_PROBES: usize = 1500;

/// The point itself and its three nearest neighbours: the third lies at about one grid step, also
/// where the grid is stretched in one direction.
const SPACING_NEIGHBOURS: usize = 4;

/// The median distance between neighbouring points, metres; 0 without points.
pub(super) fn median_spacing(points: &[Vec3]) -> f64 {
    let tree = KdTree::new(points);
    let stride = points.len().div_ceil(MAX_PROBES).max(1);
    let nearest = points
        .iter()
        .step_by(stride)
        .filter_map(|p| tree.nearest_n(p, SPACING_NEIGHBOURS).last().map(|f| f.1.sqrt()));
    median(nearest.collect()).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spacing_of_a_grid_is_its_step() {
        let points: Vec<Vec3> = (0..2500)
            .map(|i| Vec3::new(f64::from(i % 50), f64::from(i / 50), 0.0) * 0.02)
            .collect();
        assert!((median_spacing(&points) - 0.02).abs() < 1e-12);
        assert_eq!(median_spacing(&[Vec3::x(); 20]), 0.0);
        assert_eq!(median_spacing(&[]), 0.0);
    }
}
