//! The surface that all scans share: small oriented patches, and which measurements lie on them.
//!
//! A patch (surfel) is where scans meet in the joint optimisation. Its height is not a fixed target
//! but an unknown, which is eliminated later, so that each measurement counts once, however many
//! scans saw the same place.

use crate::geometry::{KdTree, MIN_INCIDENCE_COS, Pose, Twist, Vec3, transform};
use crate::register::align::factors::{point_to_plane, tukey};
use crate::register::registration_scan::RegistrationScan;
use crate::voxel::{CellIndex, split_by_side, thin_by_distance};
use rayon::prelude::*;

/// Points of a scan that are measured, at most: more add no information, because neighbours share
/// their noise.
const MAX_POINTS: usize = 12_000;
/// Steps of the search for the surfel that a ray meets.
const MAX_RAY_STEPS: usize = 3;
/// How far centres are lifted along their normals in the search tree, in distances between surfels:
/// enough to tell apart the sides of a wall that is thinner than that. A much larger lift would
/// hold a measurement to the surfels of its own, noisy normal.
const LIFT_RATIO: f64 = 0.2;
/// Robust weights whose sum is smaller are no measurement.
const MIN_WEIGHT: f64 = 0.5;
/// Length of a sum of unit normals below which it has no direction.
const MIN_NORMAL_SUM: f64 = 1e-9;

/// Patches of the surface, object frame.
pub(super) struct Surfels {
    pub centers: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    /// Distance between neighbouring surfels, metres.
    pub spacing: f64,
    /// Search tree over the lifted centres, in which the two sides of a thin wall are far apart.
    tree: KdTree,
}

/// What one scan measured of one surfel: means over its points there.
#[derive(Clone, Copy)]
pub(super) struct SurfelMeasurement {
    pub surfel: u32,
    /// Sum of the points' robust weights.
    pub weight: f64,
    /// Mean distance above the surfel's tangent plane, metres.
    pub residual: f64,
    /// Derivative of the residual by the scan's pose.
    pub jacobian: Twist,
    /// Mean square deviation of the points from their mean, square metres.
    pub variance: f64,
    /// Mean position of the points on the surface, sensor frame, metres.
    pub position: Vec3,
    /// Mean of the points' own normals, object frame.
    pub normal: Vec3,
}

/// A measured point and the surfel that it belongs to; the fields are those of
/// [`SurfelMeasurement`].
pub(super) struct SurfelPoint {
    surfel: u32,
    residual: f64,
    jacobian: Twist,
    position: Vec3,
    normal: Vec3,
}

/// A measured point with its normal and ray, object frame.
struct OrientedRay {
    point: Vec3,
    normal: Vec3,
    /// Unit vector away from the sensor.
    direction: Vec3,
}

/// Where a ray meets the surface.
struct RayHit {
    surfel: usize,
    /// Height of the measured point above the surface, metres.
    height: f64,
    /// Where the ray meets the surfel's tangent plane, object frame, metres.
    foot: Vec3,
}

/// A candidate for a surfel: the points of one side of the surface in a cell.
#[derive(Clone, Copy)]
struct Patch {
    center: Vec3,
    normal: Vec3,
    /// Number of points.
    support: usize,
}

impl Surfels {
    /// Covers the points of all `views` (scans and their poses) with surfels that are `spacing`
    /// (metres) apart; normals whose cosine is at least `min_normal_cos` belong to one side.
    pub(super) fn new(
        views: &[(&RegistrationScan, Pose)],
        spacing: f64,
        min_normal_cos: f64,
    ) -> Surfels {
        let placed: Vec<(Vec3, Vec3)> = views
            .par_iter()
            .flat_map_iter(|(scan, pose)| {
                let points = scan.map_points.iter().map(move |point| transform(pose, point));
                points.zip(scan.map_normals.iter().map(move |normal| pose.rotation * normal))
            })
            .collect();
        let (points, normals): (Vec<Vec3>, Vec<Vec3>) = placed.into_iter().unzip();
        let cells = CellIndex::new(&points, spacing);
        let patches: Vec<Vec<Patch>> = cells
            .cells()
            .par_iter()
            .map(|&cell| {
                split_by_side(cells.points_in(cell), &normals, min_normal_cos)
                    .iter()
                    .filter_map(|side| Patch::from_points(&points, &normals, side))
                    .collect()
            })
            .collect();
        Surfels::from_patches(&patches.concat(), spacing)
    }

    /// Keeps the best supported patches that are `spacing` (metres) apart.
    fn from_patches(patches: &[Patch], spacing: f64) -> Surfels {
        let centers: Vec<Vec3> = patches.iter().map(|patch| patch.center).collect();
        let normals: Vec<Vec3> = patches.iter().map(|patch| patch.normal).collect();
        let mut order: Vec<usize> = (0..patches.len()).collect();
        order.sort_by_key(|&i| (std::cmp::Reverse(patches[i].support), i));
        let kept = thin_by_distance(&centers, &normals, &order, spacing);
        Surfels::from_oriented_points(
            kept.iter().map(|&i| centers[i]).collect(),
            kept.iter().map(|&i| normals[i]).collect(),
            spacing,
        )
    }

    /// Surfels with these centres (metres) and unit normals, `spacing` (metres) apart.
    pub(super) fn from_oriented_points(
        centers: Vec<Vec3>,
        normals: Vec<Vec3>,
        spacing: f64,
    ) -> Surfels {
        let lifted: Vec<Vec3> = centers
            .iter()
            .zip(&normals)
            .map(|(center, normal)| lift(center, normal, spacing))
            .collect();
        Surfels { tree: KdTree::new(&lifted), centers, normals, spacing }
    }

    /// The surfel nearest to `point` (object frame) on the side of the surface that faces as
    /// `normal` does.
    fn nearest(&self, point: &Vec3, normal: &Vec3, reach: f64) -> Option<usize> {
        let query = lift(point, normal, self.spacing);
        self.tree.nearest_within(&query, reach.hypot(2.0 * self.spacing)).map(|(index, _)| index)
    }

    /// The surfel that a measurement belongs to: the one where its *ray* meets the surface. The
    /// measured point itself is moved along the ray by its noise, and near an object's outline more
    /// points can come from one side than from the other: matching the nearest surfel would make
    /// scans sink into the surface.
    fn cast_ray(&self, ray: &OrientedRay, reach: f64, min_normal_cos: f64) -> Option<RayHit> {
        let mut surfel = self.nearest(&ray.point, &ray.normal, reach)?;
        for _ in 0..MAX_RAY_STEPS {
            let foot = self.foot(ray, surfel)?;
            let next = self.nearest(&foot, &self.normals[surfel], reach)?;
            if next == surfel {
                break;
            }
            surfel = next;
        }
        let foot = self.foot(ray, surfel)?;
        let (center, normal) = (self.centers[surfel], self.normals[surfel]);
        let height = normal.dot(&(ray.point - center));
        let agreement = normal.dot(&ray.normal);
        let is_near = height.abs() <= reach
            && agreement >= min_normal_cos
            && (foot - center).norm_squared() <= self.spacing * self.spacing;
        // Between centre and foot the surface bends as the normals do (Rusinkiewicz 2019, A
        // Symmetric Objective Function for ICP).
        let bend = ray.normal.dot(&(foot - center)) / (1.0 + agreement);
        is_near.then_some(RayHit { surfel, height: height + bend, foot })
    }

    /// Where the ray meets the tangent plane of a surfel that faces the sensor.
    fn foot(&self, ray: &OrientedRay, surfel: usize) -> Option<Vec3> {
        let slope = self.normals[surfel].dot(&ray.direction);
        let height = self.normals[surfel].dot(&(ray.point - self.centers[surfel]));
        (slope < -MIN_INCIDENCE_COS).then(|| ray.point - ray.direction * (height / slope))
    }

    /// The points of `scan`, seen from `pose`, that lie within `reach` (metres) of a surfel whose
    /// normal agrees, ordered by surfel.
    pub(super) fn match_points(
        &self,
        scan: &RegistrationScan,
        pose: &Pose,
        reach: f64,
        min_normal_cos: f64,
    ) -> Vec<SurfelPoint> {
        let stride = scan.map_points.len().div_ceil(MAX_POINTS).max(1);
        let mut found: Vec<SurfelPoint> = (0..scan.map_points.len())
            .step_by(stride)
            .filter_map(|i| {
                let ray = OrientedRay {
                    point: transform(pose, &scan.map_points[i]),
                    normal: pose.rotation * scan.map_normals[i],
                    direction: pose.rotation * scan.map_rays[i],
                };
                let hit = self.cast_ray(&ray, reach, min_normal_cos)?;
                Some(self.surfel_point(&ray, &hit, pose))
            })
            .collect();
        found.sort_by_key(|point| point.surfel);
        found
    }

    /// The residual of a matched point and its derivative by `pose`. The derivative is taken where
    /// the surface is: at the measured point it would contain the noise once more.
    fn surfel_point(&self, ray: &OrientedRay, hit: &RayHit, pose: &Pose) -> SurfelPoint {
        let (center, normal) = (&self.centers[hit.surfel], &self.normals[hit.surfel]);
        let position =
            pose.rotation.inverse_transform_vector(&(hit.foot - pose.translation.vector));
        let (_, jacobian) = point_to_plane(pose, &position, center, normal);
        SurfelPoint {
            surfel: hit.surfel as u32,
            residual: hit.height,
            jacobian,
            position,
            normal: ray.normal,
        }
    }
}

/// What a scan measured of each surfel, ascending, from its matched `points`. Residuals count by
/// Tukey's weight for the standard deviation `sigma` (metres).
pub(super) fn measure(points: &[SurfelPoint], sigma: f64) -> Vec<SurfelMeasurement> {
    points
        .chunk_by(|a, b| a.surfel == b.surfel)
        .filter_map(|on_surfel| weighted_mean(on_surfel, sigma))
        .collect()
}

/// The mean of one scan's points on one surfel.
fn weighted_mean(points: &[SurfelPoint], sigma: f64) -> Option<SurfelMeasurement> {
    let (mut weight, mut residual, mut square) = (0.0, 0.0, 0.0);
    let (mut jacobian, mut position, mut normal) = (Twist::zeros(), Vec3::zeros(), Vec3::zeros());
    for point in points {
        let robust = tukey(point.residual / sigma);
        weight += robust;
        residual += robust * point.residual;
        square += robust * point.residual * point.residual;
        jacobian += point.jacobian * robust;
        position += point.position * robust;
        normal += point.normal * robust;
    }
    residual /= weight;
    (weight >= MIN_WEIGHT).then_some(SurfelMeasurement {
        surfel: points[0].surfel,
        weight,
        residual,
        jacobian: jacobian / weight,
        variance: (square / weight - residual * residual).max(0.0),
        position: position / weight,
        normal: normal / weight,
    })
}

/// Position of a point or a surfel in the search tree.
fn lift(point: &Vec3, normal: &Vec3, spacing: f64) -> Vec3 {
    point + normal * (LIFT_RATIO * spacing)
}

impl Patch {
    /// Mean position and normal of the points that `members` index.
    fn from_points(points: &[Vec3], normals: &[Vec3], members: &[u32]) -> Option<Patch> {
        let center = sum_of(points, members) / members.len() as f64;
        let normal = sum_of(normals, members).try_normalize(MIN_NORMAL_SUM)?;
        Some(Patch { center, normal, support: members.len() })
    }
}

fn sum_of(vectors: &[Vec3], members: &[u32]) -> Vec3 {
    members.iter().map(|&i| vectors[i as usize]).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Radius of the ball, metres.
    const RADIUS: f64 = 0.05;

    /// A single surfel 0.5 m in front of the sensor, and a ray to a point near it.
    fn surfel_and_ray() -> (Surfels, Vec3) {
        let normal = Vec3::new(0.3, -0.2, -1.0).normalize();
        let center = Vec3::new(0.01, 0.02, 0.5);
        let surfels = Surfels::from_oriented_points(vec![center], vec![normal], 0.05);
        (surfels, center + Vec3::new(4e-3, -3e-3, 5e-3))
    }

    /// The residual of a point with the surfel's own normal, measured along the ray from the
    /// sensor.
    fn residual(surfels: &Surfels, pose: &Pose, point: &Vec3) -> SurfelPoint {
        let ray = OrientedRay {
            point: transform(pose, point),
            normal: surfels.normals[0],
            direction: pose.rotation * point.normalize(),
        };
        surfels.surfel_point(&ray, &surfels.cast_ray(&ray, 0.05, 0.5).unwrap(), pose)
    }

    #[test]
    fn a_surfel_s_derivative_agrees_with_finite_differences_on_the_surface() {
        const STEP: f64 = 1e-6;
        let (surfels, point) = surfel_and_ray();
        // A point on the surface: above it, the derivative is that of the ray's foot.
        let foot = residual(&surfels, &Pose::identity(), &point).position;
        let found = residual(&surfels, &Pose::identity(), &foot);
        assert!(found.residual.abs() < 1e-12 && (found.position - foot).norm() < 1e-12);
        for k in 0..6 {
            let [up, down] = [STEP, -STEP].map(|step| {
                let xi = Twist::from_fn(|i, _| if i == k { step } else { 0.0 });
                residual(&surfels, &crate::geometry::exp(&xi), &foot).residual
            });
            assert!(((up - down) / (2.0 * STEP) - found.jacobian[k]).abs() < 1e-6, "{k}");
        }
    }

    #[test]
    fn residuals_between_surfels_of_a_ball_are_heights_above_the_ball() {
        // A surfel at the front of a ball and a point 10 mm beside it, 1 mm above the ball.
        let middle = Vec3::z() * 0.5;
        let surfels = Surfels::from_oriented_points(
            vec![middle - Vec3::z() * RADIUS],
            vec![-Vec3::z()],
            0.02,
        );
        let normal = Vec3::new(0.2, 0.0, -(1.0_f64 - 0.04).sqrt());
        let point = middle + normal * (RADIUS + 1e-3);
        let ray = OrientedRay { point, normal, direction: point.normalize() };
        let hit = surfels.cast_ray(&ray, 0.02, 0.5).unwrap();
        assert!((hit.height - 1e-3).abs() < 0.05e-3, "{}", hit.height);
        let beyond = OrientedRay { normal: -normal, ..ray };
        assert!(surfels.cast_ray(&beyond, 0.02, 0.5).is_none());
    }

    #[test]
    fn a_measurement_is_the_weighted_mean_of_its_points() {
        let points: Vec<SurfelPoint> = [1e-4, 3e-4, 1.0]
            .map(|residual| SurfelPoint {
                surfel: 7,
                residual,
                jacobian: Twist::repeat(residual),
                position: Vec3::x() * residual,
                normal: Vec3::z(),
            })
            .into();
        // The third is an outlier; the others' weights are 1 to 1e-7.
        let [found] = measure(&points, 1.0e-1)[..] else { panic!("not one measurement") };
        assert!((found.weight - 2.0).abs() < 1e-5 && found.surfel == 7);
        assert!((found.residual - 2e-4).abs() < 1e-9 && (found.jacobian[3] - 2e-4).abs() < 1e-9);
        assert!((found.variance - 1e-8).abs() < 1e-12, "{}", found.variance);
        assert!(measure(&points[2..], 1.0e-1).is_empty());
    }
}
