//! From a raw scan to oriented points in the sensor frame.

use super::normals::{Neighbourhood, PointNormals, estimate_normals};
use super::returns::Returns;
use super::spacing::{MAX_PROBES, median_spacing};
use crate::geometry::{Cloud, NoiseModel, Scan, Vec3, median};
use crate::voxel::{CellIndex, nearest_to_mean};
use crate::{Error, Result};

/// Oriented points of one scan, in the sensor frame.
#[derive(Clone, Debug, Default)]
pub struct PreparedScan {
    /// Points, metres.
    pub points: Vec<Vec3>,
    /// Unit normals, towards the sensor, of planes that do not reach round edges.
    pub normals: Vec<Vec3>,
    /// Unit normals, towards the sensor, of the planes through all neighbours: they round edges
    /// off.
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
    pub raw_indices: Vec<u32>,
    /// Points of the raw scan that have no normal.
    pub unoriented: Vec<Unoriented>,
}

/// A point that has too few neighbours for a normal, lies off their plane or at grazing incidence,
/// sensor frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unoriented {
    /// Position, metres.
    pub point: Vec3,
    /// Unit vector along the ray, away from the sensor.
    pub ray: Vec3,
    /// Distance of the sensor, metres.
    pub range: f32,
    /// Which point of the raw scan it was.
    pub raw_index: u32,
}

/// Fewer points make no scan.
const MIN_POINTS: usize = 10;
/// Radius, in spacings, of the planes that normals are taken from: about thirty points.
const NORMAL_RADIUS_SPACINGS: f64 = 3.0;
/// The same radius, in standard deviations of the noise.
const NORMAL_RADIUS_SIGMAS: f64 = 6.0;
/// Noise, in spacings, of a cloud that states no uncertainty: its points are taken as they are.
const DEFAULT_NOISE_RATIO: f64 = 0.1;
/// A sample may have this many times the points asked for.
const MAX_SAMPLE_EXCESS: f64 = 1.2;
/// Factor by which the cells of a sample grow until they are few enough.
const CELL_GROWTH: f64 = 1.15;

impl PreparedScan {
    /// Estimates normals and noise; points without enough neighbours, off their local plane or at
    /// grazing incidence are left out.
    ///
    /// # Errors
    /// [`Error::Input`] if fewer than 10 points have a return or all coincide.
    pub fn new(scan: &Scan) -> Result<PreparedScan> {
        let returns = Returns::new(scan);
        let points = &returns.points;
        if points.len() < MIN_POINTS {
            return Err(Error::input(format!(
                "the scan has {} points with a return; at least {MIN_POINTS} are needed",
                points.len()
            )));
        }
        let spacing = median_spacing(points);
        if spacing <= 0.0 {
            return Err(Error::input("most points of the scan coincide; is the file corrupt?"));
        }
        let probe = Neighbourhood::new(points, NORMAL_RADIUS_SPACINGS * spacing);
        let stride = points.len().div_ceil(MAX_PROBES);
        let residuals =
            (0..points.len()).step_by(stride).filter_map(|i| probe.fit(i)).map(|f| f.noise);
        let noise = median(residuals.collect()).unwrap_or(0.0);
        let near = Neighbourhood::new(points, normal_radius(spacing, noise));
        let normals = estimate_normals(&near, &returns.rays, noise);
        let model = returns.noise_model(&normals, spacing).unwrap_or(NoiseModel::constant(noise));
        let mut prepared = PreparedScan { spacing, noise, model, ..PreparedScan::default() };
        prepared.add(&returns, &normals);
        Ok(prepared)
    }

    /// A cloud that has normals already; each point counts as seen head on.
    ///
    /// # Errors
    /// [`Error::Input`] if there are fewer than 10 points or most coincide.
    pub fn from_cloud(cloud: &Cloud) -> Result<PreparedScan> {
        let spacing = median_spacing(&cloud.points);
        if cloud.len() < MIN_POINTS || spacing <= 0.0 {
            return Err(Error::input(format!(
                "the cloud has {} points; at least {MIN_POINTS} different ones are needed",
                cloud.len()
            )));
        }
        let known = cloud.sigma.iter().copied().filter(|s| s.is_finite()).collect();
        let noise = median(known).unwrap_or(DEFAULT_NOISE_RATIO * spacing);
        Ok(PreparedScan {
            points: cloud.points.clone(),
            normals: cloud.normals.clone(),
            smooth_normals: cloud.normals.clone(),
            rays: cloud.normals.iter().map(|n| -n).collect(),
            spacing,
            noise,
            sigma: cloud
                .sigma
                .iter()
                .map(|&sigma| if sigma.is_finite() { sigma as f32 } else { noise as f32 })
                .collect(),
            model: NoiseModel::constant(noise),
            range: vec![1.0; cloud.len()],
            raw_indices: (0..cloud.len() as u32).collect(),
            ..PreparedScan::default()
        })
    }

    /// Adds the returns that have a normal, and those that have none.
    fn add(&mut self, returns: &Returns, normals: &[Option<PointNormals>]) {
        for (i, normals) in normals.iter().enumerate() {
            let (point, ray) = (returns.points[i], returns.rays[i]);
            let (range, source) = (returns.ranges[i], returns.raw_indices[i]);
            let Some(PointNormals { sharp, smooth }) = normals else {
                self.unoriented.push(Unoriented {
                    point,
                    ray,
                    range: range as f32,
                    raw_index: source,
                });
                continue;
            };
            self.points.push(point);
            self.normals.push(*sharp);
            self.smooth_normals.push(*smooth);
            self.rays.push(ray);
            self.sigma.push(self.model.sigma_at(range, sharp.dot(&ray)) as f32);
            self.range.push(range as f32);
            self.raw_indices.push(source);
        }
    }

    /// Radius of the planes that the normals were fitted to, metres.
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
            if cells.cells().len() as f64 <= MAX_SAMPLE_EXCESS * count as f64 {
                return cells
                    .cells()
                    .iter()
                    .filter_map(|c| nearest_to_mean(&self.points, cells.points_in(*c)))
                    .collect();
            }
            edge *= CELL_GROWTH;
        }
    }
}

/// Radius of the planes that normals are taken from, metres. The tilt of a plane fitted to n points
/// within r is about 2 noise / (r sqrt(n)): six times the noise keeps it to a few degrees.
fn normal_radius(spacing: f64, noise: f64) -> f64 {
    (NORMAL_RADIUS_SPACINGS * spacing).max(NORMAL_RADIUS_SIGMAS * noise)
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

    #[test]
    fn points_without_a_normal_are_kept_apart_with_their_index() {
        let mut scan = tilted_plane();
        scan.points.push([0.03, 0.03, 0.3]);
        scan.width = 0;
        let prepared = PreparedScan::new(&scan).unwrap();
        let lone = prepared.unoriented.iter().find(|point| point.raw_index == 3600).unwrap();
        assert!((lone.point - Vec3::new(0.03, 0.03, 0.3)).norm() < 1e-7);
        assert!((f64::from(lone.range) - lone.point.norm()).abs() < 1e-7);
        assert_eq!(prepared.points.len() + prepared.unoriented.len(), 3601);
        for (point, index) in prepared.points.iter().zip(&prepared.raw_indices) {
            let raw = scan.points[*index as usize].map(f64::from);
            assert_eq!(*point, Vec3::from(raw));
        }
    }

    #[test]
    fn a_cloud_keeps_its_normals_and_stated_uncertainties() {
        let mut cloud = Cloud::default();
        for i in 0..100 {
            let sigma = if i == 7 { f64::NAN } else { 1e-4 };
            let point = Vec3::new(f64::from(i % 10), f64::from(i / 10), 0.0) * 1e-3;
            cloud.push(point, Vec3::z(), sigma, 1);
        }
        let prepared = PreparedScan::from_cloud(&cloud).unwrap();
        assert_eq!(prepared.normals, cloud.normals);
        assert!(prepared.rays.iter().all(|ray| *ray == -Vec3::z()));
        assert_eq!(prepared.noise, 1e-4);
        assert!(prepared.sigma.iter().all(|sigma| (f64::from(*sigma) - 1e-4).abs() < 1e-10));
        assert!((prepared.spacing - 1e-3).abs() < 1e-12);
        assert!(PreparedScan::from_cloud(&Cloud::default()).is_err());
    }
}
