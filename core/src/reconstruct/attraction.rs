//! Where the measured points attract a vertex to.

use crate::geometry::{Cloud, Vec3};
use crate::voxel::CellIndex;

/// The filtered points, sorted for searches round vertices.
pub(super) struct Measurements {
    /// In the order of the cells, so that neighbours in space are neighbours in memory.
    cloud: Cloud,
    cells: CellIndex,
}

/// What the points near a vertex say.
pub(super) struct Pull {
    /// Displacement of the vertex, metres.
    pub displacement: Vec3,
    /// Standard deviation of the surface there along the normal, metres.
    pub sigma: f64,
    /// Whether measured points, not those of the support plane, have most of the weight.
    pub is_measured: bool,
}

/// The pull of the points within about a width (metres, the last argument) on a vertex with a unit
/// normal; `None` where there are none.
pub(super) type PullFunction = fn(&Measurements, &Vec3, &Vec3, f64) -> Option<Pull>;

/// Radius within which points attract a vertex implicitly, in search widths: beyond it their weight
/// is below 0.002.
pub(super) const SEARCH_RADIUS_RATIO: f64 = 2.5;
/// Least cosine between the normals of a point and of the vertex (75 degrees): others belong to
/// another part of the surface.
const MIN_SAME_SIDE_COS: f64 = 0.26;
/// Points that must agree before a vertex counts as observed: three span a surface.
const MIN_POINTS: usize = 3;
/// Standard deviation believed where the cloud gives none, in search widths.
const UNKNOWN_SIGMA_RATIO: f64 = 0.25;
/// Variance that is added to that of each point, in squared search widths: it keeps a few very
/// certain points from deciding alone.
const VARIANCE_FLOOR_RATIO: f64 = 1e-2;
/// Share of the way to the mean of the points that the thesis moves a vertex.
const THESIS_STEP_RATIO: f64 = 0.5;

impl Measurements {
    /// Prepares `cloud` for searches within about `reach` (metres).
    pub(super) fn new(cloud: &Cloud, reach: f64) -> Measurements {
        let cells = CellIndex::new(&cloud.points, reach);
        let by_cell = cells.cells().iter().flat_map(|cell| cells.points_in(*cell));
        let order: Vec<usize> = by_cell.map(|&i| i as usize).collect();
        let cloud = cloud.select(&order);
        Measurements { cells: CellIndex::new(&cloud.points, reach), cloud }
    }

    /// The pull along the normal to the zero of the weighted mean distance from the points' tangent
    /// planes (implicit moving least squares; Kolluri 2008). Each plane stands halfway between the
    /// normals of point and vertex, which cancels the curvature of the surface (symmetric distance;
    /// Rusinkiewicz 2019, §3).
    ///
    /// ```text
    /// h_i = (n_i + n) . (p_i - x) / (1 + n_i . n)                                              (1)
    /// w_i = n_i . n exp(-|p_i - x|^2 / width^2) / (sigma_i^2 + floor)                          (2)
    /// ```
    pub(super) fn implicit_pull(&self, vertex: &Vec3, normal: &Vec3, width: f64) -> Option<Pull> {
        let (mut total, mut distance, mut square, mut variance, mut count) =
            (0.0, 0.0, 0.0, 0.0, 0);
        let mut measured = 0.0;
        let radius = SEARCH_RADIUS_RATIO * width;
        self.cells.for_each_within(&self.cloud.points, vertex, radius, |i, squared| {
            let agreement = self.cloud.normals[i].dot(normal);
            if agreement < MIN_SAME_SIDE_COS {
                return;
            }
            let sigma = self.sigma_or(i, UNKNOWN_SIGMA_RATIO * width);
            let weight = agreement * (-squared / (width * width)).exp()
                / (sigma * sigma + VARIANCE_FLOOR_RATIO * width * width); // (2)
            let offset = self.cloud.points[i] - vertex;
            let height = (self.cloud.normals[i] + normal).dot(&offset) / (1.0 + agreement); // (1)
            total += weight;
            measured += weight * self.measured_share(i);
            distance += weight * height;
            square += weight * height * height;
            variance += weight * sigma * sigma;
            count += 1;
        });
        if count < MIN_POINTS || total <= 0.0 {
            return None;
        }
        let mean = distance / total;
        let spread = (square / total - mean * mean).max(0.0);
        Some(Pull {
            displacement: normal * mean,
            // Neighbouring filtered points share measurements: their mean is no better than one of
            // them.
            sigma: (variance / total + spread / count as f64).sqrt(),
            is_measured: measured > 0.5 * total,
        })
    }

    /// The pull half the way to the mean of the points within `width` (Wiedemann 2014, §2.4.2); the
    /// standard deviation is that of the distances (§3.5).
    pub(super) fn thesis_pull(&self, vertex: &Vec3, normal: &Vec3, width: f64) -> Option<Pull> {
        let (mut offset, mut sum, mut square, mut count) = (Vec3::zeros(), 0.0, 0.0, 0.0);
        let mut measured = 0.0;
        self.cells.for_each_within(&self.cloud.points, vertex, width, |i, _| {
            let to_point = self.cloud.points[i] - vertex;
            let height = to_point.dot(normal);
            offset += to_point;
            sum += height;
            square += height * height;
            count += 1.0;
            measured += self.measured_share(i);
        });
        (count > 0.0).then(|| Pull {
            displacement: offset / count * THESIS_STEP_RATIO,
            sigma: (square / count - (sum / count).powi(2)).max(0.0).sqrt(),
            is_measured: measured > 0.5 * count,
        })
    }

    /// 1 if a scan saw the point, else 0.
    fn measured_share(&self, point: usize) -> f64 {
        f64::from(u8::from(self.cloud.support[point] > 0))
    }

    /// The standard deviation of the point, or `unknown` if the cloud gives none, metres.
    fn sigma_or(&self, point: usize, unknown: f64) -> f64 {
        let sigma = self.cloud.sigma[point];
        if sigma.is_finite() { sigma } else { unknown }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit sphere of evenly spread points (Fibonacci lattice).
    fn unit_sphere() -> Cloud {
        let mut cloud = Cloud::default();
        for i in 0..4000 {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 4000.0;
            let phi = f64::from(i) * 2.399_963_229_728_653;
            let r = (1.0 - z * z).sqrt();
            let n = Vec3::new(r * phi.cos(), r * phi.sin(), z);
            cloud.push(n, n, 0.01, 1);
        }
        cloud
    }

    #[test]
    fn a_vertex_comes_to_rest_on_a_sphere_without_bias() {
        let measurements = Measurements::new(&unit_sphere(), 0.2);
        for start in [0.95, 1.05] {
            let mut vertex = Vec3::new(0.0, 0.6, 0.8) * start;
            let normal = vertex.normalize();
            for _ in 0..5 {
                vertex += measurements.implicit_pull(&vertex, &normal, 0.1).unwrap().displacement;
            }
            assert!((vertex.norm() - 1.0).abs() < 5e-4, "{}", vertex.norm());
        }
        assert!(measurements.implicit_pull(&Vec3::zeros(), &Vec3::z(), 0.1).is_none());
    }

    #[test]
    fn the_implicit_distance_falls_by_one_along_the_normal() {
        // Finite differences: on a sphere the distance changes as fast as the vertex moves.
        let measurements = Measurements::new(&unit_sphere(), 0.2);
        let (normal, step) = (Vec3::new(0.0, 0.6, 0.8), 1e-3);
        let heights = [1.0 - step, 1.0 + step].map(|radius| {
            let pull = measurements.implicit_pull(&(normal * radius), &normal, 0.1).unwrap();
            pull.displacement.dot(&normal)
        });
        let slope = (heights[1] - heights[0]) / (2.0 * step);
        assert!((slope + 1.0).abs() < 0.02, "{slope}");
    }

    #[test]
    fn the_thesis_moves_half_the_way_to_the_mean_of_the_points() {
        let mut cloud = Cloud::default();
        for (height, support) in [(0.1, 1), (0.3, 2), (0.2, 0)] {
            cloud.push(Vec3::z() * height, Vec3::z(), f64::NAN, support);
        }
        let measurements = Measurements::new(&cloud, 1.0);
        let pull = measurements.thesis_pull(&Vec3::zeros(), &Vec3::z(), 1.0).unwrap();
        assert!((pull.displacement - Vec3::z() * 0.1).norm() < 1e-12, "{}", pull.displacement);
        // The variance of 0.1, 0.2 and 0.3.
        assert!((pull.sigma - (0.02_f64 / 3.0).sqrt()).abs() < 1e-12, "{}", pull.sigma);
        assert!(pull.is_measured, "two of three were measured");
        assert!(measurements.thesis_pull(&Vec3::x(), &Vec3::z(), 0.5).is_none());
    }
}
