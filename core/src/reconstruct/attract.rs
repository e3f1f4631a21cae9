//! Where the measured points want a vertex to be.

use super::DetailMethod;
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
    pub measured: bool,
}

/// Points whose normal leans away from the vertex's by more than 75 degrees belong to another part.
const SAME_SIDE: f64 = 0.26;
/// Points that must agree before a vertex counts as observed: three span a surface.
const LEAST: usize = 3;
/// Standard deviation believed where the cloud gives none, as a share of the search width.
const UNKNOWN_SIGMA: f64 = 0.25;

impl Measurements {
    /// `reach` is the usual search radius, metres.
    pub(super) fn new(cloud: &Cloud, reach: f64) -> Measurements {
        let cells = CellIndex::new(&cloud.points, reach);
        let by_cell = cells.cells().iter().flat_map(|cell| cells.points_in(*cell));
        let order: Vec<usize> = by_cell.map(|&i| i as usize).collect();
        let cloud = cloud.select(&order);
        Measurements { cells: CellIndex::new(&cloud.points, reach), cloud }
    }

    /// The pull on `vertex` with unit normal `normal`, by points within about `width` (metres); `None` where
    /// there are none.
    pub(super) fn pull(
        &self,
        vertex: &Vec3,
        normal: &Vec3,
        width: f64,
        method: DetailMethod,
    ) -> Option<Pull> {
        match method {
            DetailMethod::Implicit => self.implicit(vertex, normal, width),
            DetailMethod::Thesis => self.thesis(vertex, normal, width),
        }
    }

    /// Along the normal, to the zero of the weighted mean distance to the points' tangent planes (implicit
    /// moving least squares; Kolluri 2008). The planes stand halfway between the point's normal and the
    /// vertex's: the curvature of the surface then cancels (Rusinkiewicz 2019, §3).
    fn implicit(&self, vertex: &Vec3, normal: &Vec3, width: f64) -> Option<Pull> {
        let (mut total, mut distance, mut square, mut variance, mut count) =
            (0.0, 0.0, 0.0, 0.0, 0);
        let mut measured = 0.0;
        self.cells.for_each_within(&self.cloud.points, vertex, 2.5 * width, |i, squared| {
            let agreement = self.cloud.normals[i].dot(normal);
            if agreement < SAME_SIDE {
                return;
            }
            let sigma = self.sigma(i, width);
            // The floor keeps a few very certain points from deciding alone.
            let weight = agreement * (-squared / (width * width)).exp()
                / (sigma * sigma + 1e-2 * width * width);
            let offset = self.cloud.points[i] - vertex;
            let height = (self.cloud.normals[i] + normal).dot(&offset) / (1.0 + agreement);
            total += weight;
            measured += weight * self.measured(i);
            distance += weight * height;
            square += weight * height * height;
            variance += weight * sigma * sigma;
            count += 1;
        });
        if count < LEAST || total <= 0.0 {
            return None;
        }
        let mean = distance / total;
        let spread = (square / total - mean * mean).max(0.0);
        Some(Pull {
            displacement: normal * mean,
            // Neighbouring filtered points share measurements: their mean is no better than one of them.
            sigma: (variance / total + spread / count as f64).sqrt(),
            measured: measured > 0.5 * total,
        })
    }

    /// Half the way to the mean of the points within `width` (Wiedemann 2014, §2.4.3); the standard deviation is
    /// that of the distances (§2.4.6).
    fn thesis(&self, vertex: &Vec3, normal: &Vec3, width: f64) -> Option<Pull> {
        let (mut offset, mut sum, mut square, mut count) = (Vec3::zeros(), 0.0, 0.0, 0.0);
        let mut measured = 0.0;
        self.cells.for_each_within(&self.cloud.points, vertex, width, |i, _| {
            let to_point = self.cloud.points[i] - vertex;
            let height = to_point.dot(normal);
            offset += to_point;
            sum += height;
            square += height * height;
            count += 1.0;
            measured += self.measured(i);
        });
        (count > 0.0).then(|| Pull {
            displacement: offset / count * 0.5,
            sigma: (square / count - (sum / count).powi(2)).max(0.0).sqrt(),
            measured: measured > 0.5 * count,
        })
    }

    /// 1 if a scan saw the point, else 0.
    fn measured(&self, point: usize) -> f64 {
        f64::from(u8::from(self.cloud.support[point] > 0))
    }

    fn sigma(&self, point: usize, width: f64) -> f64 {
        let sigma = self.cloud.sigma[point];
        if sigma.is_finite() { sigma } else { UNKNOWN_SIGMA * width }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vertex_comes_to_rest_on_a_sphere_without_bias() {
        let mut cloud = Cloud::default();
        for i in 0..4000 {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 4000.0;
            let phi = f64::from(i) * 2.399_963_229_728_653;
            let r = (1.0 - z * z).sqrt();
            let n = Vec3::new(r * phi.cos(), r * phi.sin(), z);
            cloud.push(n, n, 0.01, 1);
        }
        let measurements = Measurements::new(&cloud, 0.2);
        for start in [0.95, 1.05] {
            let mut vertex = Vec3::new(0.0, 0.6, 0.8) * start;
            let normal = vertex.normalize();
            for _ in 0..5 {
                vertex += measurements
                    .pull(&vertex, &normal, 0.1, DetailMethod::Implicit)
                    .unwrap()
                    .displacement;
            }
            assert!((vertex.norm() - 1.0).abs() < 5e-4, "{}", vertex.norm());
        }
        assert!(
            measurements.pull(&Vec3::zeros(), &Vec3::z(), 0.1, DetailMethod::Implicit).is_none()
        );
    }
}
