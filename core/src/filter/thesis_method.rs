//! The filter of the thesis (Wiedemann 2014, §2.3.2): normals from the two nearest points, expected
//! positions by averaging along the normal, and of the points within the reduction radius the one
//! with the most similar measurements.

use super::params::FilterParams;
use super::pooled::PooledMeasurements;
use crate::geometry::{Cloud, KdTree, Vec3};
use crate::voxel::CellIndex;
use crate::{Progress, Result};
use rayon::prelude::*;

/// Radius of the slim neighbourhood along the normal, in noise radii. The thesis says "slim"
/// without a number.
const SLIM_RADIUS_RATIO: f64 = 0.25;
/// A normal whose cosine with the viewing direction is smaller in size is tried again with the next
/// neighbour: it is nearly orthogonal to the ray, and its sign would be arbitrary.
const MIN_INCIDENCE_COS: f64 = 0.1;
/// Neighbours that are tried, at most, to find a normal.
const MAX_NEIGHBOURS: usize = 12;
/// Share of the work that is done once the normals are there, and once the expected positions are.
const PROGRESS_AFTER_NORMALS: f64 = 0.3;
const PROGRESS_AFTER_POSITIONS: f64 = 0.8;

/// Combines `pooled` into one point per `reduction_radius` (metres) from measurements within
/// `noise_radius` (metres).
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn filter(
    pooled: &PooledMeasurements,
    noise_radius: f64,
    reduction_radius: f64,
    params: &FilterParams,
    progress: &Progress,
) -> Result<Cloud> {
    let points = &pooled.points;
    let tree = KdTree::new(points);
    let normals: Vec<Option<Vec3>> =
        (0..points.len()).into_par_iter().map(|i| estimate_normal(pooled, &tree, i)).collect();
    progress.report("filter", PROGRESS_AFTER_NORMALS)?;
    let cosine = params.max_normal_angle.cos();
    let expected: Vec<Option<ExpectedPoint>> = (0..points.len())
        .into_par_iter()
        .map(|i| average_along_normal(pooled, &normals, i, noise_radius, cosine))
        .collect();
    progress.report("filter", PROGRESS_AFTER_POSITIONS)?;
    Ok(reduce(points, &normals, &expected, reduction_radius, params.min_measurements))
}

/// The normal `(p - p1) x (p - p2)` of the two nearest points, turned to the sensor.
fn estimate_normal(pooled: &PooledMeasurements, tree: &KdTree, index: usize) -> Option<Vec3> {
    let p = pooled.points[index];
    let near = tree.nearest_n(&p, MAX_NEIGHBOURS + 1);
    let mut others = near.iter().filter(|(i, _)| *i != index).map(|(i, _)| pooled.points[*i]);
    let first = others.next()?;
    others.find_map(|second| {
        let normal = (p - first).cross(&(p - second)).try_normalize(0.0)?;
        let cosine = normal.dot(&-pooled.rays[index]);
        (cosine.abs() > MIN_INCIDENCE_COS).then(|| normal * cosine.signum())
    })
}

/// Where the surface is expected near a measurement.
struct ExpectedPoint {
    /// Metres.
    position: Vec3,
    /// Number of similar measurements.
    similar: usize,
    /// Standard deviation of the position along the normal, metres.
    sigma: f64,
    /// Number of scans that the similar measurements come from.
    scans: u16,
}

/// The mean of the similar measurements in the slim neighbourhood along the normal; `cosine` is the
/// least one between their normals.
fn average_along_normal(
    pooled: &PooledMeasurements,
    normals: &[Option<Vec3>],
    index: usize,
    noise_radius: f64,
    cosine: f64,
) -> Option<ExpectedPoint> {
    let (p, n) = (pooled.points[index], normals[index]?);
    let (mut sum, mut squares, mut similar) = (0.0, 0.0, 0);
    let mut scans: Vec<u16> = Vec::new();
    pooled.cells.for_each_within(&pooled.points, &p, noise_radius, |i, _| {
        let offset = pooled.points[i] - p;
        let height = offset.dot(&n);
        let lateral = (offset - n * height).norm();
        let is_similar = lateral <= SLIM_RADIUS_RATIO * noise_radius
            && normals[i].is_some_and(|other| other.dot(&n) >= cosine);
        if is_similar {
            sum += height;
            squares += height * height;
            similar += 1;
            if !scans.contains(&pooled.scan[i]) {
                scans.push(pooled.scan[i]);
            }
        }
    });
    let count = similar as f64;
    let variance = (squares / count - (sum / count).powi(2)).max(0.0);
    Some(ExpectedPoint {
        position: p + n * (sum / count),
        similar,
        sigma: (variance / count).sqrt(),
        scans: scans.len() as u16,
    })
}

/// The point of each reduction radius with the most similar measurements, at its expected position.
fn reduce(
    points: &[Vec3],
    normals: &[Option<Vec3>],
    expected: &[Option<ExpectedPoint>],
    reduction_radius: f64,
    min_similar: usize,
) -> Cloud {
    let mut order: Vec<usize> =
        (0..points.len()).filter(|&i| similar_count(&expected[i]) >= min_similar).collect();
    order.sort_by(|&a, &b| {
        similar_count(&expected[b]).cmp(&similar_count(&expected[a])).then(a.cmp(&b))
    });
    let cells = CellIndex::new(points, reduction_radius);
    let mut dropped = vec![false; points.len()];
    let mut cloud = Cloud::default();
    for i in order {
        if dropped[i] {
            continue;
        }
        cells.for_each_within(points, &points[i], reduction_radius, |j, _| dropped[j] = true);
        if let (Some(e), Some(n)) = (&expected[i], normals[i]) {
            cloud.push(e.position, n, e.sigma, e.scans);
        }
    }
    cloud
}

fn similar_count(expected: &Option<ExpectedPoint>) -> usize {
    expected.as_ref().map_or(0, |e| e.similar)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pose;
    use crate::scan::PreparedScan;

    /// A scan of points at these heights above one another, seen from below.
    fn stacked(heights: &[f64]) -> PreparedScan {
        let count = heights.len();
        PreparedScan {
            points: heights.iter().map(|z| Vec3::new(0.0, 0.0, *z)).collect(),
            normals: vec![-Vec3::z(); count],
            rays: vec![Vec3::z(); count],
            sigma: vec![1e-4; count],
            range: vec![1.0; count],
            ..PreparedScan::default()
        }
    }

    #[test]
    fn the_expected_point_is_the_mean_along_the_normal() {
        let scan = stacked(&[1.0, 1.001, 1.005]);
        let pooled = PooledMeasurements::new(&[(&scan, Pose::identity())], 0.01).unwrap();
        let normals = vec![Some(-Vec3::z()); 3];
        let found = average_along_normal(&pooled, &normals, 0, 0.01, 0.7).unwrap();
        assert!((found.position.z - 1.002).abs() < 1e-12, "{}", found.position);
        assert_eq!((found.similar, found.scans), (3, 1));
        // Variance (0 + 1 + 25) / 3 - 4 = 14 / 3 square millimetres, of a mean of three a third.
        assert!((found.sigma - 1e-3 * (14.0_f64 / 9.0).sqrt()).abs() < 1e-9, "{}", found.sigma);
    }

    #[test]
    fn of_neighbours_the_one_with_most_similar_measurements_is_kept() {
        let points = [Vec3::zeros(), Vec3::x() * 0.5, Vec3::x() * 5.0];
        let expected: Vec<Option<ExpectedPoint>> = [3, 7, 1]
            .into_iter()
            .zip(&points)
            .map(|(similar, p)| Some(ExpectedPoint { position: *p, similar, sigma: 0.0, scans: 1 }))
            .collect();
        let cloud = reduce(&points, &[Some(Vec3::z()); 3], &expected, 1.0, 2);
        assert_eq!(cloud.points, [points[1]]);
    }
}
