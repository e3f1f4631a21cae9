//! How far a measurement lies off the filtered cloud.

use super::measurement::Measurement;
use crate::filter::noise_estimate::NoiseEstimate;
use crate::filter::pooled::{MIN_SIGMA_M, PooledMeasurements};
use crate::geometry::{Cloud, NoiseComponents, NoiseModel, Vec3};
use crate::voxel::CellIndex;

/// Standard deviations within which a measurement belongs to a surface: of normally distributed
/// ones, one in 16,000 lies beyond.
const MAX_SURFACE_SIGMAS: f64 = 4.0;
/// Distance along the surface, in noise radii, within which a point of the cloud stands for it.
const LATERAL_REACH: f64 = 0.75;
/// Factor on the height of the search: standard deviations differ between measurements.
const SEARCH_HEIGHT_RATIO: f64 = 1.5;
/// Largest cosine between ray and outward normal. It would be negative, because no surface is
/// measured from behind, but normals are uncertain by some degrees.
const MAX_BACKFACING_COS: f64 = 0.1;
/// Cosine of the incidence from which on a ray certainly meets the surface beside it. At a more
/// grazing angle it may pass over it.
const MIN_FACING_COS: f64 = 0.4;
/// Least cosine between the normals of one side of a surface.
pub(super) const MIN_SAME_SIDE_COS: f64 = 0.8;
/// A measurement that is fewer standard deviations above what lies beneath it needs no other
/// explanation.
const MAX_EXPLAINED_SIGMAS: f64 = 1.5;
/// Cosine of the incidence from which on the intersection of a ray with the surface is looked for.
/// At a more grazing angle noise moves it too far.
const MIN_INTERSECTION_COS: f64 = 0.25;
/// Steps of Newton's method to where a ray meets the surface.
const NEWTON_STEPS: usize = 2;
/// Sides of the surface that a measurement is compared with, the nearest first: a corner has three.
const MAX_SIDES: usize = 3;
/// Least weight of a tangent plane, so that far ones count if there are no others.
const MIN_PLANE_WEIGHT: f64 = 1e-12;

/// How far a measurement lies off the side of the surface that explains it best.
pub(super) struct Deviation {
    /// The place of the surface beneath the measurement, object frame, metres.
    pub foot: Vec3,
    /// Outward normal of the surface there, about of unit length.
    pub normal: Vec3,
    /// Height above the surface in the measurement's standard deviations.
    pub height: f64,
    /// Variance of the surface in the same units.
    pub surface_variance: f64,
}

impl Deviation {
    /// How many standard deviations the measurement is off the surface.
    pub(super) fn sigmas(&self, noise: &NoiseComponents) -> f64 {
        self.height.abs() / (noise.total() + self.surface_variance).sqrt()
    }

    /// Whether the measurement may belong to the surface.
    pub(super) fn is_on_surface(&self, noise: &NoiseComponents) -> bool {
        self.sigmas(noise) <= MAX_SURFACE_SIGMAS
    }
}

/// Distances of measurements from the filtered cloud.
pub(super) struct SurfaceDistance<'a> {
    cloud: &'a Cloud,
    cells: CellIndex,
    /// Reach along the surface, metres.
    lateral: f64,
    /// Reach in all directions, metres.
    search: f64,
    /// Distance between the points of the cloud, metres.
    spacing: f64,
    sensor: NoiseModel,
    noise: &'a NoiseEstimate,
}

/// One side of the surface near a place.
struct SurfaceSide {
    /// Height of the place above it, metres.
    height: f64,
    normal: Vec3,
    /// Variance of the surface, square metres.
    variance: f64,
}

/// A point of the cloud near a place, and its squared distance along the surface.
struct NearPoint {
    lateral_squared: f64,
    index: usize,
}

impl<'a> SurfaceDistance<'a> {
    /// Distances from `cloud`, which was made of `pooled` with `noise_radius` and has points
    /// `spacing` apart (metres).
    pub(super) fn new(
        cloud: &'a Cloud,
        pooled: &PooledMeasurements,
        noise_radius: f64,
        spacing: f64,
        noise: &'a NoiseEstimate,
    ) -> SurfaceDistance<'a> {
        let total = noise.components.total().sqrt();
        let largest = pooled.sigma.iter().copied().fold(MIN_SIGMA_M, f32::max);
        let lateral = LATERAL_REACH * noise_radius;
        let search =
            lateral + SEARCH_HEIGHT_RATIO * MAX_SURFACE_SIGMAS * total * f64::from(largest);
        let cells = CellIndex::new(&cloud.points, search);
        SurfaceDistance { cells, cloud, lateral, search, spacing, sensor: pooled.sensor, noise }
    }

    /// The deviation from the place beneath the measurement or from that along its ray, where the
    /// noise acts, whichever explains it better; `None` if there is no cloud at either.
    pub(super) fn deviation(&self, m: &Measurement) -> Option<Deviation> {
        let beneath = self.nearest_side(m, &m.point).map(|side| {
            let foot = m.point - side.normal * side.height;
            self.deviation_from(&side, m, side.height, foot)
        });
        let noise = &self.noise.components;
        if beneath.as_ref().is_some_and(|d| d.sigmas(noise) <= MAX_EXPLAINED_SIGMAS) {
            return beneath;
        }
        let both = beneath.into_iter().chain(self.deviation_along_ray(m));
        both.min_by(|a, b| a.sigmas(noise).total_cmp(&b.sigmas(noise)))
    }

    /// The deviation from where the measurement's ray meets the surface next to it, in front or
    /// behind.
    fn deviation_along_ray(&self, m: &Measurement) -> Option<Deviation> {
        let steps = (self.search - self.lateral) / (MIN_INTERSECTION_COS * self.lateral);
        let around = (1..=steps.ceil() as i32).flat_map(|k| [k, -k]);
        let mut starts = std::iter::once(0).chain(around).map(|k| f64::from(k) * self.lateral);
        starts.find_map(|start| self.intersect_ray(m, start))
    }

    /// The deviation from where the measurement's ray meets the surface, by Newton's method from
    /// the distance `start` (metres) behind the measurement; `None` if it meets none near there.
    fn intersect_ray(&self, m: &Measurement, start: f64) -> Option<Deviation> {
        let mut at = start;
        for _ in 0..NEWTON_STEPS {
            let side = self.nearest_side(m, &(m.point + m.ray * at))?;
            let cosine = m.ray.dot(&side.normal);
            let step = -side.height / cosine;
            if cosine > -MIN_INTERSECTION_COS || (at + step - start).abs() > self.lateral {
                return None;
            }
            at += step;
        }
        let foot = m.point + m.ray * at;
        let side = self.nearest_side(m, &foot)?;
        let height = side.height - at * m.ray.dot(&side.normal);
        Some(self.deviation_from(&side, m, height, foot))
    }

    /// The side of the cloud that is nearest to the place `at` of the measurement; `None` if no
    /// point of the cloud is beside it.
    fn nearest_side(&self, m: &Measurement, at: &Vec3) -> Option<SurfaceSide> {
        let mut near: Vec<NearPoint> = Vec::new();
        self.cells.for_each_within(&self.cloud.points, at, self.search, |index, _| {
            near.extend(
                self.lateral_distance_squared(m, at, index)
                    .map(|lateral_squared| NearPoint { lateral_squared, index }),
            );
        });
        let mut best: Option<SurfaceSide> = None;
        for _ in 0..MAX_SIDES {
            let nearest = near.iter().min_by(|a, b| {
                a.lateral_squared.total_cmp(&b.lateral_squared).then(a.index.cmp(&b.index))
            });
            let Some(nearest) = nearest else { break };
            let axis = self.cloud.normals[nearest.index];
            let side = self.blend_planes(at, near.iter().filter(|p| self.is_same_side(p, &axis)));
            near.retain(|p| !self.is_same_side(p, &axis));
            let is_nearer = best.as_ref().is_none_or(|b| side.height.abs() < b.height.abs());
            if is_nearer {
                best = Some(side);
            }
        }
        best
    }

    fn is_same_side(&self, point: &NearPoint, axis: &Vec3) -> bool {
        self.cloud.normals[point.index].dot(axis) >= MIN_SAME_SIDE_COS
    }

    /// Squared distance along the surface from the point `j` of the cloud, if that may be what was
    /// measured at `at`, square metres. The place is moved to the tangent plane along its normal or
    /// along the ray, on which the noise acts.
    fn lateral_distance_squared(&self, m: &Measurement, at: &Vec3, j: usize) -> Option<f64> {
        let normal = &self.cloud.normals[j];
        let offset = at - self.cloud.points[j];
        let (height, cosine) = (offset.dot(normal), m.ray.dot(normal));
        if cosine > MAX_BACKFACING_COS {
            return None;
        }
        let beneath = offset.norm_squared() - height * height;
        let square = if cosine < -MIN_FACING_COS {
            beneath.min((offset - m.ray * (height / cosine)).norm_squared())
        } else {
            beneath
        };
        (square <= self.lateral * self.lateral).then_some(square)
    }

    /// One side beneath `at`, blended from the tangent planes of its points with normal weights of
    /// half the spacing: only the near ones count.
    fn blend_planes<'p>(
        &self,
        at: &Vec3,
        points: impl Iterator<Item = &'p NearPoint>,
    ) -> SurfaceSide {
        let cloud = self.cloud;
        let (mut weights, mut height, mut normal, mut variance) = (0.0, 0.0, Vec3::zeros(), 0.0);
        for point in points {
            let j = point.index;
            let weight = (-2.0 * point.lateral_squared / (self.spacing * self.spacing))
                .exp()
                .max(MIN_PLANE_WEIGHT);
            weights += weight;
            height += weight * (at - cloud.points[j]).dot(&cloud.normals[j]);
            normal += cloud.normals[j] * weight;
            variance += weight * cloud.sigma[j] * cloud.sigma[j];
        }
        SurfaceSide {
            height: height / weights,
            normal: normal / weights,
            variance: variance / weights,
        }
    }

    /// The deviation of the measurement, which lies `height` (metres) above `side` at `foot`.
    fn deviation_from(
        &self,
        side: &SurfaceSide,
        m: &Measurement,
        height: f64,
        foot: Vec3,
    ) -> Deviation {
        let cosine = m.ray.dot(&side.normal);
        let stated = self.sensor.sigma_at(m.range, cosine).max(f64::from(MIN_SIGMA_M));
        let sigma = stated * self.noise.correction.sigma_at(m.range, cosine);
        Deviation {
            foot,
            normal: side.normal,
            height: height / sigma,
            surface_variance: side.variance / (sigma * sigma),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Pose, Scan};
    use crate::scan::PreparedScan;

    const SIGMA: f64 = 8e-4;
    const RADIUS: f64 = 0.02;

    /// The outward normal of a cylinder about the y axis, seen along z.
    fn cylinder_normal(angle: f64) -> Vec3 {
        Vec3::new(angle.sin(), 0.0, -angle.cos())
    }

    fn cylinder() -> Cloud {
        let mut cloud = Cloud::default();
        for i in -80..=80 {
            for j in -20..=20 {
                let n = cylinder_normal(f64::from(i) * 0.02);
                cloud.push(n * RADIUS + Vec3::y() * (f64::from(j) * 4e-4), n, 1e-5, 9);
            }
        }
        cloud
    }

    /// A measurement along z that is this many standard deviations before the cylinder, where it is
    /// seen at this cosine of the incidence.
    fn measurement(cosine: f64, sigmas: f64) -> Measurement {
        let hit = cylinder_normal(-cosine.acos()) * RADIUS;
        let point = hit - Vec3::z() * (sigmas * SIGMA / cosine);
        Measurement { point, ray: Vec3::z(), range: 0.3, source: 0, is_oriented: true }
    }

    #[test]
    fn a_measurement_is_compared_with_the_place_where_its_ray_meets_the_surface() {
        let cloud = cylinder();
        let points = (0..400).map(|i| [(i % 20) as f32 * 1e-3, (i / 20) as f32 * 1e-3, 0.3]);
        let scan = Scan { points: points.collect(), width: 20, origins: Vec::new() };
        let scan = PreparedScan::new(&scan).unwrap();
        let mut pooled = PooledMeasurements::new(&[(&scan, Pose::identity())], 4e-3).unwrap();
        pooled.sensor = NoiseModel::constant(SIGMA);
        pooled.sigma.fill(SIGMA as f32);
        let components = NoiseComponents::WHITE;
        let noise = NoiseEstimate { correction: NoiseModel::constant(1.0), components };
        let surface = SurfaceDistance::new(&cloud, &pooled, 4e-3, 4e-4, &noise);
        let found = [(0.35, 3.0), (0.9, 3.0), (0.35, 8.0)].map(|(cosine, sigmas)| {
            surface.deviation(&measurement(cosine, sigmas)).unwrap().sigmas(&components)
        });
        // The nearest point of the cylinder is 4.1 standard deviations from the first.
        assert!((found[0] - 3.0).abs() < 0.05, "{found:?}");
        assert!((found[1] - 3.0).abs() < 0.05, "{found:?}");
        assert!(found[2] > 6.0, "{found:?}");
    }
}
