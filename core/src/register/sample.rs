//! One scan made ready for registration.

use super::align::{Map, Moving, Rejection, Surface, Thinned, boundary, select};
use super::factors::point_motion;
use super::{PoseSigma, PreparedScan, RegisterParams};
use crate::geometry::{Aabb, Mat6, Pose, Vec3, median};

/// One scan made ready for registration, sensor frame.
pub(crate) struct Sample {
    /// The points that are aligned.
    pub points: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    /// Unit vectors along their rays, away from the sensor.
    pub rays: Vec<Vec3>,
    /// Denser points: the map is made of them.
    pub targets: Vec<Vec3>,
    pub target_normals: Vec<Vec3>,
    /// Unit vectors along their rays, away from the sensor.
    pub target_rays: Vec<Vec3>,
    /// Whether each target lies at the scan's border; empty where no one asks.
    pub target_boundary: Vec<bool>,
    /// Distance between the targets, metres.
    pub target_spacing: f64,
    pub noise: f64,
    /// Within how far the points around one have a say in its normal, metres.
    pub normal_radius: f64,
    /// Median distance of the points from the sensor, metres.
    pub distance: f64,
    /// Diagonal of the points' box, metres.
    pub extent: f64,
}

impl Sample {
    /// Of a scan whose pose the robot knows by `sigma`.
    pub(crate) fn new(scan: &PreparedScan, sigma: PoseSigma, params: &RegisterParams) -> Sample {
        let distance = median(scan.points.iter().map(Vec3::norm).collect()).unwrap_or(0.0);
        let edges_tell = sigma.of_point(distance) > EDGE_ERROR * scan.normal_radius();
        let normals = if edges_tell { &scan.smooth_normals } else { &scan.normals };
        let kept = select(scan, params);
        let points: Vec<Vec3> = kept.iter().map(|&i| scan.points[i]).collect();
        let dense = scan.sample(TARGETS);
        let targets: Vec<Vec3> = dense.iter().map(|&i| scan.points[i]).collect();
        let target_normals: Vec<Vec3> = dense.iter().map(|&i| normals[i]).collect();
        let target_spacing =
            scan.spacing * (scan.points.len() as f64 / targets.len().max(1) as f64).sqrt();
        let target_boundary = if params.stages().rejection == Rejection::Boundary {
            boundary(&targets, &target_normals, target_spacing)
        } else {
            Vec::new()
        };
        Sample {
            rays: kept.iter().map(|&i| scan.rays[i]).collect(),
            normals: kept.iter().map(|&i| normals[i]).collect(),
            noise: scan.noise.max(1e-6),
            normal_radius: scan.normal_radius(),
            target_spacing,
            target_boundary,
            distance,
            extent: Aabb::of(&targets).diagonal(),
            target_rays: dense.iter().map(|&i| scan.rays[i]).collect(),
            target_normals,
            targets,
            points,
        }
    }

    /// The points as what is aligned, with residuals of deviation `noise` (metres).
    pub(crate) fn moving(&self, noise: f64) -> Moving<'_> {
        Moving { points: &self.points, normals: &self.normals, rays: &self.rays, noise }
    }

    /// Every `stride`-th of the points.
    pub(crate) fn every(&self, stride: usize) -> Thinned {
        self.moving(self.noise).every(stride)
    }

    /// The map of the targets of `scans`, each seen from its pose.
    pub(crate) fn map_of<'a>(
        scans: impl Iterator<Item = (&'a Sample, &'a Pose)>,
        voxel: f64,
    ) -> Map {
        Map::of(scans.map(|(sample, pose)| (sample.surface(), pose)), voxel)
    }

    /// Adds the targets, seen from `pose`, to the map.
    pub(crate) fn add_to(&self, map: &mut Map, pose: &Pose) {
        map.insert(&self.surface(), pose);
    }

    fn surface(&self) -> Surface<'_> {
        Surface {
            points: &self.targets,
            normals: &self.target_normals,
            boundary: &self.target_boundary,
        }
    }

    /// Standard deviation of the points, along the axis that is least certain, for a pose of this information, metres.
    pub(crate) fn moved_by(&self, information: &Mat6) -> f64 {
        let Some(covariance) = information.try_inverse() else { return f64::INFINITY };
        let stride = self.points.len().div_ceil(PROBES).max(1);
        let probes = self.points.iter().step_by(stride).map(|p| {
            let moves = point_motion(p);
            (moves * covariance * moves.transpose()).symmetric_eigenvalues().max().max(0.0).sqrt()
        });
        median(probes.collect()).unwrap_or(0.0)
    }

    /// Root mean square distance of the points between two poses, metres.
    pub(crate) fn displacement(&self, a: &Pose, b: &Pose) -> f64 {
        let stride = self.points.len().div_ceil(PROBES).max(1);
        let place = |pose: &Pose, p: &Vec3| pose.rotation * p + pose.translation.vector;
        let squares: Vec<f64> = self
            .points
            .iter()
            .step_by(stride)
            .map(|p| (place(a, p) - place(b, p)).norm_squared())
            .collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    }

    /// Radius within which an aligned point finds its surface, with residuals of deviation `noise` (metres).
    pub(crate) fn reach(&self, noise: f64) -> f64 {
        (3.0 * self.target_spacing).max(4.0 * noise)
    }
}

/// How far off a scan may come to rest by normals that round edges off, as a share of the radius of
/// their planes: scans of boxes and prisms at exact poses moved by .14 to .32 of it towards their
/// sensors. Edges are all that holds what faces leave open, the thickness of a plate or a slide along
/// a wall. So where the robot knows its poses better than that, they must not outvote it; where it
/// knows them less well, rounded edges are the better witness.
const EDGE_ERROR: f64 = 1.0 / 3.0;
/// Points that tell how far an uncertain pose moves a scan.
const PROBES: usize = 64;
/// Targets kept of a scan: at a tenth of a million, searches take longer and find nothing better.
const TARGETS: usize = 40_000;
