//! The truth about the simulated noise, for the assessment alone and not for any algorithm: its
//! true size and correlation, and measurements that are turned into outliers.

use super::labels::{GOOD_LABEL, OUTLIER_LABEL};
use super::noise_family::NoiseFamily;
use super::random::{RandomSource, RandomUse};
use super::sensor_output::single_precision;
use super::simulated_view::SimulatedScans;
use super::{laser, stereo};
use crate::geometry::Vec3;
use rand::RngExt;

/// The true covariance of the measurements of one simulated scan.
#[derive(Clone, Copy, Debug)]
pub struct TrueNoise {
    is_stereo: bool,
    width: usize,
    height: usize,
}

impl TrueNoise {
    /// The noise of scans of a family with this many columns and rows.
    pub fn new(family: NoiseFamily, width: usize, height: usize) -> TrueNoise {
        TrueNoise { is_stereo: family.is_stereo(), width, height }
    }

    /// Standard deviation along the ray, metres, of a hit (sensor frame) whose ray meets the
    /// surface at this cosine.
    pub fn sigma(&self, hit: &Vec3, ray: &Vec3, cosine: f64) -> f64 {
        if self.is_stereo {
            stereo::depth_sigma(hit.z, cosine) / ray.z
        } else {
            laser::range_sigma(cosine)
        }
    }

    /// Correlation of the noise along the rays of two points, by their indices in the scan.
    pub fn correlation(&self, a: usize, b: usize) -> f64 {
        if a == b {
            return 1.0;
        }
        if !self.is_stereo {
            return 0.0;
        }
        let columns = (a % self.width).abs_diff(b % self.width);
        let rows = (a / self.width).abs_diff(b / self.width);
        stereo::depth_correlation(columns as f64, rows as f64)
    }

    /// Covariance per axis of the arm's random walk at two points, by their indices in the scan,
    /// square metres.
    pub fn walk_covariance(&self, a: usize, b: usize) -> f64 {
        if self.is_stereo {
            return 0.0;
        }
        // Number of steps from the middle profile, where the walk is zero.
        let [a, b] = [a, b].map(|i| (i / self.width) as f64 - (self.height / 2) as f64);
        let common = if a * b > 0.0 { a.abs().min(b.abs()) } else { 0.0 };
        common * laser::WALK_STEP_SIGMA * laser::WALK_STEP_SIGMA
    }

    /// Variance per axis of the arm's random walk, mean of all profiles, square metres.
    pub fn mean_walk_variance(&self) -> f64 {
        if self.is_stereo { 0.0 } else { self.height as f64 / 4.0 * laser::WALK_STEP_SIGMA.powi(2) }
    }
}

/// Share of outliers among the points of the sensor of a family.
pub fn outlier_share(family: NoiseFamily) -> f64 {
    if family.is_stereo() { stereo::OUTLIER_RATIO } else { laser::OUTLIER_RATIO }
}

/// Turns the share `share` of the ordinary measurements into outliers anywhere along their rays
/// within `reach` (metres) of where they were.
pub fn add_outliers(scans: &mut SimulatedScans, share: f64, reach: f64, seed: u64) {
    for (index, view) in scans.views.iter_mut().enumerate() {
        let mut rng = RandomSource { seed, view: index as u64 }.rng(RandomUse::AddedOutliers, 0);
        for i in 0..view.scan.points.len() {
            let Some(point) = view.scan.point(i) else { continue };
            if view.labels[i] != GOOD_LABEL || !rng.random_bool(share) {
                continue;
            }
            let sight = point - view.scan.origin(i);
            let moved = point + sight.normalize() * rng.random_range(-reach..reach);
            view.scan.points[i] = single_precision(&moved);
            view.labels[i] = OUTLIER_LABEL;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Progress;
    use crate::mesh::test_shapes::cuboid;
    use crate::simulate::{SimulateParams, simulate};

    fn scans(family: NoiseFamily) -> SimulatedScans {
        let cube = cuboid(Vec3::zeros(), Vec3::new(0.08, 0.08, 0.08));
        let params = SimulateParams { family, views: 3, ..SimulateParams::default() };
        simulate(&cube, &params, 3, &Progress::silent()).unwrap()
    }

    #[test]
    fn the_noise_has_the_size_that_is_stated() {
        for family in [NoiseFamily::P1, NoiseFamily::P3] {
            let scans = scans(family);
            let (mut sum, mut count) = (0.0, 0.0);
            for view in &scans.views {
                let noise = TrueNoise::new(family, view.scan.width, view.scan.height());
                let into = view.true_pose.inverse();
                for i in view.scan.returns().filter(|&i| view.labels[i] == GOOD_LABEL) {
                    let hit = Vec3::from(view.hits[i].map(f64::from));
                    let at = view.true_pose * nalgebra::Point3::from(hit);
                    let (ray, error) = {
                        let sight = view.scan.point(i).unwrap() - view.scan.origin(i);
                        let ray = sight.normalize();
                        (ray, (view.scan.point(i).unwrap() - hit).dot(&ray))
                    };
                    // The face that was met is the axis along which the hit lies on the cube's
                    // border.
                    let off_border: Vec<f64> =
                        (0..3).map(|k| ((at[k] - 0.04).abs() - 0.04).abs()).collect();
                    let axis =
                        (0..3).min_by(|&a, &b| off_border[a].total_cmp(&off_border[b])).unwrap();
                    let mut normal = Vec3::zeros();
                    normal[axis] = 1.0;
                    let cosine = (into.rotation * normal).dot(&ray).abs();
                    let sigma =
                        noise.sigma(&hit, &ray, cosine).powi(2) + noise.walk_covariance(i, i);
                    sum += error * error / sigma;
                    count += 1.0;
                }
            }
            let ratio: f64 = sum / count;
            assert!((ratio.sqrt() - 1.0).abs() < 0.15, "{family:?}: {ratio}");
        }
    }

    #[test]
    fn outliers_are_added_along_their_rays() {
        let clean = scans(NoiseFamily::P1);
        let mut scans = clean.clone();
        add_outliers(&mut scans, 0.1, 0.05, 1);
        let (view, before) = (&scans.views[0], &clean.views[0]);
        let outliers: Vec<usize> =
            view.scan.returns().filter(|&i| view.labels[i] != before.labels[i]).collect();
        let share = outliers.len() as f64 / view.scan.returns().count() as f64;
        assert!((share - 0.1).abs() < 0.01, "{share}");
        for i in outliers {
            let [ray, ray_before] =
                [view, before].map(|v| (v.scan.point(i).unwrap() - v.scan.origin(i)).normalize());
            assert!((ray - ray_before).norm() < 1e-5);
        }
    }
}
