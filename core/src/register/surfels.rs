//! The surface that all scans share: small oriented patches, and which measurements lie on them.
//!
//! A patch (surfel) is where scans meet in the joint optimisation. Its height is no fixed target but an unknown that
//! is eliminated, so that each measurement counts once, however many scans saw the same place.

use super::sample::Sample;
use crate::geometry::{KdTree, Pose, Twist, Vec3};
use crate::voxel::{CellIndex, keep_apart, sides};
use rayon::prelude::*;

use super::factors::{point_to_plane, tukey};

/// Patches of the surface, object frame.
pub(crate) struct Surfels {
    pub centers: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    /// Distance between the patches, metres.
    pub edge: f64,
    /// Over the centres, each lifted along its normal: the two sides of a thin wall are far apart in it.
    tree: KdTree,
}

/// What one scan measured of one surfel: means over its points there.
#[derive(Clone, Copy)]
pub(crate) struct Term {
    pub surfel: u32,
    /// Sum of the points' robust weights.
    pub weight: f64,
    /// Mean distance above the surfel's tangent plane, metres.
    pub residual: f64,
    /// Its derivative by the scan's pose.
    pub jacobian: Twist,
    /// Mean square about the mean, square metres.
    pub variance: f64,
    /// Mean place of the points on the surface, sensor frame, metres.
    pub at: Vec3,
    /// Mean of the points' own normals, object frame.
    pub normal: Vec3,
}

/// A measured point with its normal and ray, object frame.
struct Measurement {
    point: Vec3,
    normal: Vec3,
    /// Unit vector away from the sensor.
    direction: Vec3,
}

/// A measurement and the surfel that it belongs to; see [`Term`].
pub(crate) struct OnSurfel {
    surfel: u32,
    residual: f64,
    jacobian: Twist,
    at: Vec3,
    normal: Vec3,
}

/// Points of a scan that are looked at: more tell nothing new, because neighbours share their noise.
const POINTS: usize = 12_000;
/// Steps to where a ray meets the surface.
const RAY_STEPS: usize = 3;
/// Cosine of the incidence (80 degrees) beyond which a ray meets the surface nowhere in particular.
const GRAZING: f64 = 0.17;
/// How far centres are lifted along their normals in the search tree, in distances between surfels: enough to tell the
/// sides of a wall that is thinner than that. Much more would hold a measurement to surfels of its own, noisy normal.
const LIFT: f64 = 0.2;
/// Robust weights below this sum are no measurement.
const LEAST_WEIGHT: f64 = 0.5;

impl Surfels {
    /// Covers the points of all `views` (samples and their poses) with surfels at the distance `edge` (metres);
    /// normals within `cosine` belong to one side.
    pub(crate) fn new(views: &[(&Sample, Pose)], edge: f64, cosine: f64) -> Surfels {
        let placed: Vec<(Vec3, Vec3)> = views
            .par_iter()
            .flat_map_iter(|(sample, pose)| {
                let move_point = move |p: &Vec3| pose.rotation * p + pose.translation.vector;
                let moved = sample.targets.iter().map(move_point);
                moved.zip(sample.target_normals.iter().map(move |n| pose.rotation * n))
            })
            .collect();
        let (points, normals): (Vec<Vec3>, Vec<Vec3>) = placed.into_iter().unzip();
        let cells = CellIndex::new(&points, edge);
        let patch = |side: &Vec<u32>| patch(&points, &normals, side);
        let in_cell = |&cell| -> Vec<(Vec3, Vec3, usize)> {
            sides(cells.points_in(cell), &normals, cosine).iter().filter_map(patch).collect()
        };
        let found: Vec<_> = cells.cells().par_iter().map(in_cell).collect();
        Surfels::thinned(&found.concat(), edge)
    }

    /// Keeps the best supported surfels.
    fn thinned(found: &[(Vec3, Vec3, usize)], edge: f64) -> Surfels {
        let centers: Vec<Vec3> = found.iter().map(|f| f.0).collect();
        let normals: Vec<Vec3> = found.iter().map(|f| f.1).collect();
        let mut order: Vec<usize> = (0..found.len()).collect();
        order.sort_by_key(|&i| (std::cmp::Reverse(found[i].2), i));
        let kept = keep_apart(&centers, &normals, &order, edge);
        let of = |all: &[Vec3]| kept.iter().map(|&i| all[i]).collect();
        Surfels::of(of(&centers), of(&normals), edge)
    }

    /// Surfels with these centres (metres) and unit normals, `edge` apart.
    pub(crate) fn of(centers: Vec<Vec3>, normals: Vec<Vec3>, edge: f64) -> Surfels {
        let lift = |(center, normal)| lifted(center, normal, edge);
        let tree = KdTree::new(&centers.iter().zip(&normals).map(lift).collect::<Vec<Vec3>>());
        Surfels { centers, normals, edge, tree }
    }

    /// The surfel nearest to `point` (object frame) on the side of the surface that faces as `normal` does.
    fn nearest(&self, point: &Vec3, normal: &Vec3, reach: f64) -> Option<usize> {
        let query = lifted(point, normal, self.edge);
        self.tree.nearest_within(&query, reach.hypot(2.0 * self.edge)).map(|(index, _)| index)
    }

    /// The surfel that a measurement belongs to: where its *ray* meets the surface. The measured point itself is moved
    /// along the ray by its noise, and near an object's outline there are more points that can come from one side
    /// than from the other: the nearest surfel would make scans sink in.
    fn met_by(&self, ray: &Measurement, reach: f64, cosine: f64) -> Option<(usize, f64, Vec3)> {
        let mut index = self.nearest(&ray.point, &ray.normal, reach)?;
        for _ in 0..RAY_STEPS {
            let foot = self.foot(ray, index)?;
            let next = self.nearest(&foot, &self.normals[index], reach)?;
            if next == index {
                break;
            }
            index = next;
        }
        let foot = self.foot(ray, index)?;
        let (center, there) = (self.centers[index], self.normals[index]);
        let height = there.dot(&(ray.point - center));
        let agreement = there.dot(&ray.normal);
        let near = height.abs() <= reach
            && agreement >= cosine
            && (foot - center).norm_squared() <= self.edge * self.edge;
        // Between centre and foot the surface bends as the normals do (Rusinkiewicz 2019, A Symmetric Objective
        // Function for ICP).
        let bend = ray.normal.dot(&(foot - center)) / (1.0 + agreement);
        near.then_some((index, height + bend, foot))
    }

    /// Where the ray meets the tangent plane of a surfel that faces the sensor.
    fn foot(&self, ray: &Measurement, index: usize) -> Option<Vec3> {
        let slope = self.normals[index].dot(&ray.direction);
        let height = self.normals[index].dot(&(ray.point - self.centers[index]));
        (slope < -GRAZING).then(|| ray.point - ray.direction * (height / slope))
    }

    /// The points of `sample`, seen from `pose`, that lie within `reach` (metres) of a surfel, by surfel, ascending.
    pub(crate) fn met(
        &self,
        sample: &Sample,
        pose: &Pose,
        reach: f64,
        cosine: f64,
    ) -> Vec<OnSurfel> {
        let meets = |i: usize| {
            let ray = Measurement {
                point: pose.rotation * sample.targets[i] + pose.translation.vector,
                normal: pose.rotation * sample.target_normals[i],
                direction: pose.rotation * sample.target_rays[i],
            };
            let (index, residual, foot) = self.met_by(&ray, reach, cosine)?;
            // The derivative where the surface is: at the measured point it would hold the noise once more.
            let at = pose.rotation.inverse_transform_vector(&(foot - pose.translation.vector));
            let (_, jacobian) =
                point_to_plane(pose, &at, &self.centers[index], &self.normals[index]);
            Some(OnSurfel { surfel: index as u32, residual, jacobian, at, normal: ray.normal })
        };
        let stride = sample.targets.len().div_ceil(POINTS).max(1);
        let mut found: Vec<OnSurfel> =
            (0..sample.targets.len()).step_by(stride).filter_map(meets).collect();
        found.sort_by_key(|on| on.surfel);
        found
    }
}

/// What a scan measured of each surfel, ascending, of points that lie on them. Residuals are believed up to some `scale`
/// (metres, a standard deviation).
pub(crate) fn terms(met: &[OnSurfel], scale: f64) -> Vec<Term> {
    met.chunk_by(|a, b| a.surfel == b.surfel).filter_map(|of| mean(of, scale)).collect()
}

/// The mean of one scan's measurements of one surfel.
fn mean(found: &[OnSurfel], scale: f64) -> Option<Term> {
    let (mut weight, mut residual, mut square) = (0.0, 0.0, 0.0);
    let (mut jacobian, mut at, mut normal) = (Twist::zeros(), Vec3::zeros(), Vec3::zeros());
    for on in found {
        let robust = tukey(on.residual / scale);
        weight += robust;
        residual += robust * on.residual;
        square += robust * on.residual * on.residual;
        jacobian += on.jacobian * robust;
        at += on.at * robust;
        normal += on.normal * robust;
    }
    residual /= weight;
    (weight >= LEAST_WEIGHT).then_some(Term {
        surfel: found[0].surfel,
        weight,
        residual,
        jacobian: jacobian / weight,
        variance: (square / weight - residual * residual).max(0.0),
        at: at / weight,
        normal: normal / weight,
    })
}

/// Where a point or a surfel stands in the search tree.
fn lifted(point: &Vec3, normal: &Vec3, edge: f64) -> Vec3 {
    point + normal * (LIFT * edge)
}

/// Centre, mean normal and number of the points of one side of the surface in a cell.
fn patch(points: &[Vec3], normals: &[Vec3], members: &[u32]) -> Option<(Vec3, Vec3, usize)> {
    let sum = |of: &[Vec3]| members.iter().map(|&i| of[i as usize]).sum::<Vec3>();
    let center = sum(points) / members.len() as f64;
    sum(normals).try_normalize(1e-9).map(|normal| (center, normal, members.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Scan;
    use crate::register::{PoseSigma, PreparedScan, RegisterParams};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    const RADIUS: f64 = 0.05;
    const NOISE: f64 = 1.5e-3;
    const EXACT: PoseSigma = PoseSigma { translation: 0.0, rotation: 0.0 };

    /// A ball before a camera 0.5 m away, with noise along the rays and ever fewer points towards its outline.
    fn ball(rng: &mut ChaCha8Rng) -> PreparedScan {
        let mut points = Vec::new();
        for i in 0..200 * 200 {
            let (x, y) = ((i % 200) as f64 * 6e-4 - 0.06, (i / 200) as f64 * 6e-4 - 0.06);
            let ray = Vec3::new(x, y, 0.5).normalize();
            let along = ray.z * 0.5;
            let inside = RADIUS * RADIUS - (0.25 - along * along);
            if inside < 0.0 {
                continue;
            }
            let depth = along - inside.sqrt();
            let incidence = (inside.sqrt() / RADIUS).acos().to_degrees();
            if rng.random_bool(((incidence - 50.0) / 25.0).clamp(0.0, 1.0)) {
                continue;
            }
            let noise: f64 = rng.sample(StandardNormal);
            let point = ray * (depth + NOISE * noise);
            points.push([point.x as f32, point.y as f32, point.z as f32]);
        }
        PreparedScan::new(&Scan { points, ..Scan::default() }).unwrap()
    }

    #[test]
    fn noise_along_the_rays_does_not_push_the_outline_inwards() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let sample = Sample::new(&ball(&mut rng), EXACT, &RegisterParams::default());
        // The true surface as surfels.
        let center = Vec3::z() * 0.5;
        let normals: Vec<Vec3> = (0..600)
            .map(|i| {
                // Golden-angle spiral.
                let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 600.0;
                let angle = 2.399963 * f64::from(i);
                let r = (1.0 - z * z).sqrt();
                Vec3::new(r * angle.cos(), r * angle.sin(), z)
            })
            .collect();
        let centers = normals.iter().map(|n| center + n * RADIUS).collect();
        let surfels = Surfels::of(centers, normals, 8e-3);
        let met = surfels.met(&sample, &Pose::identity(), 8e-3, 0.5);
        let terms = terms(&met, 8e-3);
        let outline = terms.iter().filter(|t| {
            let ray = surfels.centers[t.surfel as usize].normalize();
            (-surfels.normals[t.surfel as usize].dot(&ray)).acos().to_degrees() > 55.0
        });
        let (sum, weight) =
            outline.fold((0.0, 0.0), |(s, w), t| (s + t.weight * t.residual, w + t.weight));
        assert!(weight > 500.0, "{weight}");
        assert!((sum / weight).abs() < 0.08e-3, "{} mm", sum / weight * 1e3);
    }
}
