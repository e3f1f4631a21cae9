//! From a raw scan to oriented points in the sensor frame.

use super::normals::{Neighbourhood, PointNormals, normals};
use crate::geometry::{Cloud, KdTree, NoiseModel, Residual, Scan, Vec3, median};
use crate::voxel::{CellIndex, most_central};
use crate::{Error, Result};
use rayon::prelude::*;

/// Oriented points of one scan, in the sensor frame.
#[derive(Clone, Debug, Default)]
pub struct PreparedScan {
    /// Points, metres.
    pub points: Vec<Vec3>,
    /// Unit normals, towards the sensor, of planes that do not reach round edges.
    pub normals: Vec<Vec3>,
    /// Unit normals, towards the sensor, of the planes through all neighbours: they round edges off.
    pub smooth_normals: Vec<Vec3>,
    /// Unit vectors along the rays, away from the sensor.
    pub rays: Vec<Vec3>,
    /// Median distance between neighbouring points, metres.
    pub spacing: f64,
    /// Standard deviation of the points about their local planes, metres.
    pub noise: f64,
    /// The same for each point, along its normal, by range and incidence, metres.
    pub sigma: Vec<f32>,
    /// Distance of the sensor, metres.
    pub range: Vec<f32>,
    /// What `sigma` was taken from.
    pub model: NoiseModel,
    /// Which point of the raw scan each was; where several were merged, the first of them.
    pub source: Vec<u32>,
    /// Points of the raw scan that have no normal.
    pub aside: Vec<Unoriented>,
}

/// A point that has too few neighbours for a normal, lies off their plane or at grazing incidence, sensor frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unoriented {
    /// Position, metres.
    pub point: Vec3,
    /// Unit vector along the ray, away from the sensor.
    pub ray: Vec3,
    /// Distance of the sensor, metres.
    pub range: f32,
    /// Which point of the raw scan it was.
    pub source: u32,
}

/// Points sampled to learn a scan's spacing and noise: enough for a median to 3 %.
const PROBES: usize = 1500;
/// Residuals from which the noise is learnt by range and incidence: some thousand a class.
const RESIDUALS: usize = 20_000;
/// Radius, in spacings, of the planes whose residuals tell the noise.
const SMALL: f64 = 2.0;
/// Points of a scan that are kept at most: above, neighbours are merged, which loses no information because
/// such scans are far denser than the finest mesh made of them.
const MOST_POINTS: usize = 200_000;

impl PreparedScan {
    /// Estimates normals and noise; points without enough neighbours, off their local plane or at grazing
    /// incidence are left out.
    ///
    /// # Errors
    /// [`Error::Input`] if fewer than 10 points have a return or all coincide.
    pub fn new(scan: &Scan) -> Result<PreparedScan> {
        let raw = Raw::of(scan);
        let points = &raw.points;
        if points.len() < 10 {
            return Err(Error::input(format!(
                "the scan has {} points with a return; at least 10 are needed",
                points.len()
            )));
        }
        let spacing = median_spacing(points);
        if spacing <= 0.0 {
            return Err(Error::input("most points of the scan coincide; is the file corrupt?"));
        }
        let probe = Neighbourhood::new(points, 3.0 * spacing);
        let stride = points.len().div_ceil(PROBES);
        let residuals =
            (0..points.len()).step_by(stride).filter_map(|i| probe.fit(i)).map(|f| f.noise);
        let noise = median(residuals.collect()).unwrap_or(0.0);
        let near = Neighbourhood::new(points, normal_radius(spacing, noise));
        let oriented = normals(&near, &raw.rays, noise);
        let model = raw.noise_model(&oriented, spacing).unwrap_or(NoiseModel::constant(noise));
        Ok(raw
            .prepared(&oriented, PreparedScan { spacing, noise, model, ..PreparedScan::default() }))
    }

    /// A cloud that has normals already; each point counts as seen head on.
    ///
    /// # Errors
    /// [`Error::Input`] if there are fewer than 10 points or most coincide.
    pub fn of_cloud(cloud: &Cloud) -> Result<PreparedScan> {
        let spacing = median_spacing(&cloud.points);
        if cloud.len() < 10 || spacing <= 0.0 {
            return Err(Error::input(format!(
                "the cloud has {} points; at least 10 different ones are needed",
                cloud.len()
            )));
        }
        let known = cloud.sigma.iter().copied().filter(|s| s.is_finite()).collect();
        // Without a stated uncertainty the points are taken as they are.
        let noise = median(known).unwrap_or(0.1 * spacing);
        let stated = |s: &f64| if s.is_finite() { *s as f32 } else { noise as f32 };
        Ok(PreparedScan {
            points: cloud.points.clone(),
            normals: cloud.normals.clone(),
            smooth_normals: cloud.normals.clone(),
            rays: cloud.normals.iter().map(|n| -n).collect(),
            spacing,
            noise,
            sigma: cloud.sigma.iter().map(stated).collect(),
            model: NoiseModel::constant(noise),
            range: vec![1.0; cloud.len()],
            source: (0..cloud.len() as u32).collect(),
            ..PreparedScan::default()
        })
    }

    /// Within how far the points around one have a say in its normal, metres.
    pub(crate) fn normal_radius(&self) -> f64 {
        normal_radius(self.spacing, self.noise)
    }

    /// One point a cubic cell, so that about `count` remain: indices, ascending by cell.
    pub fn sample(&self, count: usize) -> Vec<usize> {
        if self.points.len() <= count {
            return (0..self.points.len()).collect();
        }
        let mut edge = self.spacing * (self.points.len() as f64 / count as f64).sqrt();
        loop {
            let cells = CellIndex::new(&self.points, edge);
            if cells.cells().len() as f64 <= 1.2 * count as f64 {
                return cells
                    .cells()
                    .iter()
                    .filter_map(|c| most_central(&self.points, cells.points_in(*c)))
                    .collect();
            }
            edge *= 1.15;
        }
    }
}

/// The returns of a scan, thinned if there are too many.
struct Raw {
    points: Vec<Vec3>,
    rays: Vec<Vec3>,
    ranges: Vec<f64>,
    source: Vec<u32>,
}

impl Raw {
    fn of(scan: &Scan) -> Raw {
        let indices: Vec<usize> = scan.returns().collect();
        let point = |&i: &usize| scan.point(i).unwrap_or_else(Vec3::zeros);
        let sight: Vec<Vec3> = indices.iter().map(|i| point(i) - scan.origin(*i)).collect();
        let raw = Raw {
            points: indices.iter().map(point).collect(),
            rays: sight.iter().map(|s| s.try_normalize(0.0).unwrap_or_else(Vec3::z)).collect(),
            ranges: sight.iter().map(Vec3::norm).collect(),
            source: indices.iter().map(|&i| i as u32).collect(),
        };
        if indices.len() <= MOST_POINTS { raw } else { raw.thinned() }
    }

    fn thinned(&self) -> Raw {
        let count = self.points.len() as f64;
        let mut edge = median_spacing(&self.points) * (count / MOST_POINTS as f64).sqrt();
        if edge <= 0.0 {
            edge = 1e-6;
        }
        let cells = CellIndex::new(&self.points, edge);
        let members = |cell| cells.points_in(cell);
        let mean = |members: &[u32], of: &[Vec3]| {
            members.iter().map(|&i| of[i as usize]).sum::<Vec3>() / members.len() as f64
        };
        let all = || cells.cells().iter().map(|&cell| members(cell));
        Raw {
            points: all().map(|m| mean(m, &self.points)).collect(),
            rays: all()
                .map(|m| mean(m, &self.rays).try_normalize(0.0).unwrap_or_else(Vec3::z))
                .collect(),
            ranges: all().map(|m| self.ranges[m[0] as usize]).collect(),
            source: all().map(|m| self.source[m[0] as usize]).collect(),
        }
    }

    /// The noise by range and incidence, from distances to planes so small that no curvature counts.
    fn noise_model(&self, oriented: &[Option<PointNormals>], spacing: f64) -> Option<NoiseModel> {
        let near = Neighbourhood::new(&self.points, SMALL * spacing);
        let stride = oriented.len().div_ceil(RESIDUALS).max(1);
        let some: Vec<usize> = (0..oriented.len()).step_by(stride).collect();
        let residual = |&i: &usize| {
            let (normal, fit) = (oriented[i]?, near.fit(i)?);
            let off = (self.points[i] - fit.center).dot(&fit.normal);
            Some(Residual {
                range: self.ranges[i],
                cosine: normal.sharp.dot(&self.rays[i]).abs(),
                // In the middle of its neighbours a point's leverage in their plane is 1 / count.
                distance: off / (1.0 - 1.0 / fit.count).sqrt(),
            })
        };
        let residuals: Vec<Option<Residual>> = some.par_iter().map(residual).collect();
        let residuals: Vec<Residual> = residuals.into_iter().flatten().collect();
        NoiseModel::estimate(&residuals).map(NoiseModel::of_sensor)
    }

    /// Fills in the points with a normal and those without.
    fn prepared(
        &self,
        oriented: &[Option<PointNormals>],
        mut prepared: PreparedScan,
    ) -> PreparedScan {
        for (i, oriented) in oriented.iter().enumerate() {
            let (point, ray, range, source) =
                (self.points[i], self.rays[i], self.ranges[i], self.source[i]);
            let Some(PointNormals { sharp, smooth }) = oriented else {
                prepared.aside.push(Unoriented { point, ray, range: range as f32, source });
                continue;
            };
            prepared.points.push(point);
            prepared.normals.push(*sharp);
            prepared.smooth_normals.push(*smooth);
            prepared.rays.push(ray);
            prepared.sigma.push(prepared.model.at(range, sharp.dot(&ray)) as f32);
            prepared.range.push(range as f32);
            prepared.source.push(source);
        }
        prepared
    }
}

/// Radius of the planes that normals are taken from, metres. The tilt of a plane fitted to n points
/// within r is about 2 noise / (r sqrt(n)): six times the noise keeps it to a few degrees.
fn normal_radius(spacing: f64, noise: f64) -> f64 {
    (3.0 * spacing).max(6.0 * noise)
}

fn median_spacing(points: &[Vec3]) -> f64 {
    let tree = KdTree::new(points);
    let stride = points.len().div_ceil(PROBES);
    let nearest = points
        .iter()
        .step_by(stride)
        .filter_map(|p| tree.nearest_n(p, 4).last().map(|f| f.1.sqrt()));
    // The third neighbour lies at about one grid step, also where the grid is stretched in one direction.
    median(nearest.collect()).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tilted_plane() -> Scan {
        let points = (0..60 * 60)
            .map(|i| {
                let (x, y) = ((i % 60) as f32 * 1e-3, (i / 60) as f32 * 1e-3);
                [x, y, 0.5 + 0.5 * x + 2e-5 * ((i * 7919) % 13) as f32]
            })
            .collect();
        Scan { points, width: 60, origins: Vec::new() }
    }

    #[test]
    fn normals_point_to_the_sensor() {
        let prepared = PreparedScan::new(&tilted_plane()).unwrap();
        let expected = Vec3::new(0.5, 0.0, -1.0).normalize();
        assert!(prepared.points.len() > 3400);
        for normal in &prepared.normals {
            assert!(normal.dot(&expected) > 0.99);
        }
        assert!((prepared.spacing / 1.05e-3 - 1.0).abs() < 0.15, "{}", prepared.spacing);
        assert!(prepared.noise > 2e-5 && prepared.noise < 1e-4, "{}", prepared.noise);
    }

    #[test]
    fn a_lone_point_is_left_out_and_ten_are_needed() {
        let mut scan = tilted_plane();
        scan.points.push([0.03, 0.03, 0.3]);
        scan.width = 0;
        let prepared = PreparedScan::new(&scan).unwrap();
        assert!(prepared.points.iter().all(|p| p.z > 0.4));
        scan.points.truncate(5);
        assert!(PreparedScan::new(&scan).unwrap_err().to_string().contains("5 points"));
    }

    #[test]
    fn sampling_keeps_about_the_count_asked_for() {
        let prepared = PreparedScan::new(&tilted_plane()).unwrap();
        let sample = prepared.sample(500);
        assert!(sample.len() > 300 && sample.len() <= 600, "{}", sample.len());
    }
}
