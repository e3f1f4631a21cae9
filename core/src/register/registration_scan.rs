//! One scan made ready for registration.

use super::align::factors::point_motion;
use super::align::{Map, MapSurface, Source, SourceSubset, find_boundary, select_points};
use super::params::Rejection;
use super::strategy::Strategy;
use crate::geometry::{Aabb, Mat6, Pose, Vec3, median, transform};
use crate::scan::{PoseSigma, PreparedScan};

/// The error of a pose from which on normals that round edges off are used, as a share of the
/// radius of their planes. Such normals move scans of boxes and prisms at exact poses by 0.14 to
/// 0.32 of that radius towards their sensors. Edges are all that holds what faces leave open, the
/// thickness of a plate or a slide along a wall. So where the robot knows its poses better than
/// this, rounded edges must not outvote it; where it knows them less well, they are the better
/// evidence.
const MIN_EDGE_ERROR_RATIO: f64 = 1.0 / 3.0;
/// Points from which the motion of a scan with an uncertain pose is computed: their median is known
/// to a tenth.
const MAX_PROBE_POINTS: usize = 64;
/// Points of a scan that join the map at most: with a tenth of a million, searches take longer and
/// poses are no better.
const MAX_MAP_POINTS: usize = 40_000;
/// The noise of a scan is taken to be at least this, metres, so that exact data have a finite
/// information.
const MIN_NOISE_M: f64 = 1e-6;
/// An aligned point finds its surface within this many distances between the map's points...
const REACH_SPACINGS: f64 = 3.0;
/// ...and this many standard deviations of the residuals.
const REACH_SIGMAS: f64 = 4.0;

/// One scan made ready for registration, sensor frame.
pub(crate) struct RegistrationScan {
    /// The points that are aligned, metres.
    pub points: Vec<Vec3>,
    /// Their unit normals, towards the sensor.
    pub normals: Vec<Vec3>,
    /// Unit vectors along their rays, away from the sensor.
    pub rays: Vec<Vec3>,
    /// Denser points, of which the map is made, metres.
    pub map_points: Vec<Vec3>,
    /// Unit normals of the map's points, towards the sensor.
    pub map_normals: Vec<Vec3>,
    /// Unit vectors along the rays of the map's points, away from the sensor.
    pub map_rays: Vec<Vec3>,
    /// Whether each of the map's points lies at the scan's border; empty where it is not asked for.
    pub map_boundary: Vec<bool>,
    /// Distance between the map's points, metres.
    pub map_spacing: f64,
    /// Standard deviation of a point along its normal, metres.
    pub noise: f64,
    /// Radius of the planes that the normals were fitted to, metres.
    pub normal_radius: f64,
    /// Median distance of the points from the sensor, metres.
    pub distance: f64,
    /// Diagonal of the points' bounding box, metres.
    pub extent: f64,
}

impl RegistrationScan {
    /// Samples a scan. `sigma` is the deviation of the robot's poses.
    pub(crate) fn new(
        scan: &PreparedScan,
        sigma: PoseSigma,
        strategy: &Strategy,
    ) -> RegistrationScan {
        let distance = median(scan.points.iter().map(Vec3::norm).collect()).unwrap_or(0.0);
        let uses_smooth_normals =
            sigma.point_sigma(distance) > MIN_EDGE_ERROR_RATIO * scan.normal_radius();
        let normals = if uses_smooth_normals { &scan.smooth_normals } else { &scan.normals };
        let kept = select_points(scan, strategy);
        let dense = scan.sample(MAX_MAP_POINTS);
        let map_points: Vec<Vec3> = dense.iter().map(|&i| scan.points[i]).collect();
        let map_normals: Vec<Vec3> = dense.iter().map(|&i| normals[i]).collect();
        let thinning = scan.points.len() as f64 / map_points.len().max(1) as f64;
        let map_spacing = scan.spacing * thinning.sqrt();
        let map_boundary = if strategy.rejection == Rejection::Boundary {
            find_boundary(&map_points, &map_normals, map_spacing)
        } else {
            Vec::new()
        };
        RegistrationScan {
            points: kept.iter().map(|&i| scan.points[i]).collect(),
            normals: kept.iter().map(|&i| normals[i]).collect(),
            rays: kept.iter().map(|&i| scan.rays[i]).collect(),
            noise: scan.noise.max(MIN_NOISE_M),
            normal_radius: scan.normal_radius(),
            distance,
            extent: Aabb::from_points(&map_points).diagonal(),
            map_rays: dense.iter().map(|&i| scan.rays[i]).collect(),
            map_spacing,
            map_boundary,
            map_normals,
            map_points,
        }
    }

    /// The points to be aligned, with residuals of standard deviation `noise` (metres).
    pub(crate) fn source(&self, noise: f64) -> Source<'_> {
        Source { points: &self.points, normals: &self.normals, rays: &self.rays, noise }
    }

    /// Every `stride`-th of the points.
    pub(crate) fn every(&self, stride: usize) -> SourceSubset {
        self.source(self.noise).every(stride)
    }

    /// The map of `scans`, each with its pose `object_from_sensor`.
    pub(crate) fn map_of<'a>(
        scans: impl Iterator<Item = (&'a RegistrationScan, &'a Pose)>,
        voxel: f64,
    ) -> Map {
        Map::from_surfaces(scans.map(|(scan, pose)| (scan.map_surface(), pose)), voxel)
    }

    /// The map of this scan alone, with a voxel of edge `voxel` (metres).
    pub(crate) fn own_map(&self, pose: &Pose, voxel: f64) -> Map {
        RegistrationScan::map_of(std::iter::once((self, pose)), voxel)
    }

    /// Adds the scan at `pose` (`object_from_sensor`) to the map.
    pub(crate) fn add_to(&self, map: &mut Map, pose: &Pose) {
        map.insert(&self.map_surface(), pose);
    }

    fn map_surface(&self) -> MapSurface<'_> {
        MapSurface {
            points: &self.map_points,
            normals: &self.map_normals,
            boundary: &self.map_boundary,
        }
    }

    /// A few points, spread over the scan.
    fn probes(&self) -> impl Iterator<Item = &Vec3> {
        let stride = self.points.len().div_ceil(MAX_PROBE_POINTS).max(1);
        self.points.iter().step_by(stride)
    }

    /// Median standard deviation of the points, each along its least certain axis, for a pose with
    /// the information `information`, metres.
    pub(crate) fn moved_by(&self, information: &Mat6) -> f64 {
        let Some(covariance) = information.try_inverse() else { return f64::INFINITY };
        let sigmas = self.probes().map(|p| {
            let motion = point_motion(p);
            let covariance = motion * covariance * motion.transpose();
            covariance.symmetric_eigenvalues().max().max(0.0).sqrt()
        });
        median(sigmas.collect()).unwrap_or(0.0)
    }

    /// Root mean square distance of the points between two poses, metres.
    pub(crate) fn displacement(&self, a: &Pose, b: &Pose) -> f64 {
        let squares: Vec<f64> =
            self.probes().map(|p| (transform(a, p) - transform(b, p)).norm_squared()).collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    }

    /// Radius within which an aligned point finds its surface, with residuals of standard deviation
    /// `noise`, metres.
    pub(crate) fn reach(&self, noise: f64) -> f64 {
        (REACH_SPACINGS * self.map_spacing).max(REACH_SIGMAS * noise)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Scan, Twist, exp};
    use crate::register::params::RegisterParams;

    const EXACT: PoseSigma = PoseSigma { translation: 1e-6, rotation: 1e-6 };

    /// Two faces of a roof with its ridge along y, half a metre from the sensor.
    fn roof() -> PreparedScan {
        let points = (0..100 * 60)
            .map(|i| {
                let (x, y) = ((i % 100) as f32 * 1e-3 - 0.05, (i / 100) as f32 * 1e-3 - 0.03);
                [x, y, 0.5 + 0.6 * x.abs() + 1e-5 * ((i * 7919) % 13) as f32]
            })
            .collect();
        PreparedScan::new(&Scan { points, width: 100, origins: Vec::new() }).unwrap()
    }

    fn registration_scan(params: RegisterParams, sigma: PoseSigma) -> RegistrationScan {
        RegistrationScan::new(&roof(), sigma, &Strategy::new(&params))
    }

    #[test]
    fn a_translation_moves_all_points_by_its_length() {
        let scan = registration_scan(RegisterParams::default(), EXACT);
        let here = exp(&Twist::new(0.1, 0.2, 0.3, 0.4, 0.5, 0.6));
        let there = Pose::translation(0.003, 0.0, -0.004) * here;
        assert!((scan.displacement(&here, &there) - 0.005).abs() < 1e-12);
    }

    #[test]
    fn points_are_as_uncertain_as_the_pose_that_moves_them() {
        let scan = registration_scan(RegisterParams::default(), EXACT);
        // A translation alone moves each point by its deviation.
        let sigma = PoseSigma { translation: 0.002, rotation: 1e-6 };
        assert!((scan.moved_by(&sigma.information()) - 0.002).abs() < 1e-8);
        // A turn moves a point half a metre away by half its angle, across the line of sight.
        let sigma = PoseSigma { translation: 1e-6, rotation: 0.01 };
        let moved = scan.moved_by(&sigma.information());
        assert!(moved > 0.004_9 && moved < 0.005_6, "{moved}");
        assert_eq!(scan.moved_by(&Mat6::zeros()), f64::INFINITY);
    }

    #[test]
    fn edges_are_rounded_only_where_the_robot_knows_its_poses_badly() {
        let prepared = roof();
        let strategy = Strategy::new(&RegisterParams::default());
        let exact = RegistrationScan::new(&prepared, EXACT, &strategy);
        let uncertain = PoseSigma { translation: 0.003, rotation: 0.01 };
        let rounded = RegistrationScan::new(&prepared, uncertain, &strategy);
        assert_eq!(exact.map_normals, prepared.normals);
        assert_eq!(rounded.map_normals, prepared.smooth_normals);
        assert_ne!(exact.map_normals, rounded.map_normals);
        assert_eq!(exact.map_points, rounded.map_points);
    }

    #[test]
    fn the_boundary_is_found_only_if_pairs_on_it_are_rejected() {
        assert!(registration_scan(RegisterParams::default(), EXACT).map_boundary.is_empty());
        let params = RegisterParams { rejection: Rejection::Boundary, ..RegisterParams::default() };
        let scan = registration_scan(params, EXACT);
        assert_eq!(scan.map_boundary.len(), scan.map_points.len());
        let share = scan.map_boundary.iter().filter(|at_border| **at_border).count() as f64
            / scan.map_boundary.len() as f64;
        assert!(share > 0.03 && share < 0.2, "{share}");
    }
}
