//! Where a measurement stands to the filtered cloud.

use super::learnt::Learnt;
use super::merged::{LEAST_SIGMA, Merged};
use crate::geometry::{Cloud, Components, NoiseModel, Pose, Vec3};
use crate::register::PreparedScan;
use crate::voxel::CellIndex;

/// Standard deviations within which a measurement belongs to a surface: one good one in 16,000 lies beyond.
const REACH: f64 = 4.0;
/// Along the surface, a point of the cloud speaks for this many noise radii around.
const BESIDE: f64 = 0.75;
/// A surface is not measured from behind; normals are uncertain by some degrees.
const BEHIND: f64 = 0.1;
/// Cosine from which on a ray surely meets the surface near by. At a more grazing angle it may pass over it.
const FACING: f64 = 0.4;
/// Cosine between the normals of one side of a surface at least.
pub(super) const ONE_SIDE: f64 = 0.8;
/// A measurement that is fewer standard deviations above what lies beneath it needs no other explanation.
const CLEARLY: f64 = 1.5;
/// Cosine from which on the place where a ray meets the surface is looked for. At a more grazing angle noise moves it too far.
const GRAZING: f64 = 0.25;
/// Steps of Newton's method to where a ray meets the surface.
const MEETING: usize = 2;
/// Sides of the surface that a measurement is held against, the nearest first: a corner has three.
const SIDES: usize = 3;

/// One measurement, object frame.
pub(super) struct Measurement {
    pub point: Vec3,
    pub ray: Vec3,
    pub range: f64,
    /// In the raw scan.
    pub source: u32,
    /// Whether the scan alone gave it a normal: those that it did not are outliers more often.
    pub oriented: bool,
}

impl Measurement {
    /// All of a scan, those without a normal too.
    pub(super) fn all_of(scan: &PreparedScan, pose: &Pose) -> Vec<Measurement> {
        let posed =
            |point: &Vec3, ray: &Vec3, range: f32, source: u32, oriented: bool| Measurement {
                oriented,
                point: pose.rotation * point + pose.translation.vector,
                ray: pose.rotation * ray,
                range: f64::from(range),
                source,
            };
        let oriented = (0..scan.points.len())
            .map(|i| posed(&scan.points[i], &scan.rays[i], scan.range[i], scan.source[i], true));
        let aside = scan.aside.iter().map(|a| posed(&a.point, &a.ray, a.range, a.source, false));
        oriented.chain(aside).collect()
    }
}

/// Where a measurement stands to the side of the surface that explains it best.
pub(super) struct Standing {
    /// Beneath the measurement, object frame, metres.
    pub foot: Vec3,
    pub normal: Vec3,
    /// Height above the surface in the measurement's standard deviations.
    pub height: f64,
    /// Variance of the surface in the same units.
    pub surface: f64,
}

impl Standing {
    /// How many standard deviations the measurement is off the surface.
    pub(super) fn off(&self, noise: &Components) -> f64 {
        self.height.abs() / (noise.total() + self.surface).sqrt()
    }

    /// Whether it may belong to the surface.
    pub(super) fn is_on_surface(&self, noise: &Components) -> bool {
        self.off(noise) <= REACH
    }
}

/// The filtered cloud as measurements are held against it.
pub(super) struct Explainer<'a> {
    cloud: &'a Cloud,
    cells: CellIndex,
    /// Along the surface, metres.
    beside: f64,
    /// In all, metres.
    search: f64,
    /// Between the points of the cloud, metres.
    spacing: f64,
    sensor: NoiseModel,
    noise: &'a Learnt,
}

impl<'a> Explainer<'a> {
    pub(super) fn new(
        cloud: &'a Cloud,
        merged: &Merged,
        noise_radius: f64,
        spacing: f64,
        noise: &'a Learnt,
    ) -> Explainer<'a> {
        let total = noise.components.total().sqrt();
        let largest = merged.sigma.iter().copied().fold(LEAST_SIGMA, f32::max);
        let beside = BESIDE * noise_radius;
        let search = beside + 1.5 * REACH * total * f64::from(largest);
        let cells = CellIndex::new(&cloud.points, search);
        Explainer { cells, cloud, beside, search, spacing, sensor: merged.sensor, noise }
    }

    /// Of the places beneath the measurement and along its ray, where the noise is, the one that explains it better; `None` if
    /// there is no cloud at either.
    pub(super) fn standing(&self, m: &Measurement) -> Option<Standing> {
        let beneath = self.nearest_side(m, &m.point).map(|side| {
            let foot = m.point - side.normal * side.height;
            self.held_against(m, side.height, foot, &side)
        });
        let off = |s: &Standing| s.off(&self.noise.components);
        if beneath.as_ref().is_some_and(|s| off(s) <= CLEARLY) {
            return beneath;
        }
        let both = beneath.into_iter().chain(self.along_ray(m));
        both.min_by(|a, b| off(a).total_cmp(&off(b)))
    }

    /// Where the measurement's ray meets the surface next to it, in front or behind.
    fn along_ray(&self, m: &Measurement) -> Option<Standing> {
        let steps = ((self.search - self.beside) / (GRAZING * self.beside)).ceil() as i32;
        let around = (1..=steps).flat_map(|k| [k, -k]);
        let places = std::iter::once(0).chain(around).map(|k| f64::from(k) * self.beside);
        let meets = |start: f64| -> Option<Standing> {
            let mut at = start;
            for _ in 0..MEETING {
                let side = self.nearest_side(m, &(m.point + m.ray * at))?;
                let cosine = m.ray.dot(&side.normal);
                let step = -side.height / cosine;
                if cosine > -GRAZING || (at + step - start).abs() > self.beside {
                    return None;
                }
                at += step;
            }
            let foot = m.point + m.ray * at;
            let side = self.nearest_side(m, &foot)?;
            let height = side.height - at * m.ray.dot(&side.normal);
            Some(self.held_against(m, height, foot, &side))
        };
        places.into_iter().find_map(meets)
    }

    /// The side of the cloud that is nearest to the place `at` of the measurement; `None` if no point of the cloud is beside it.
    fn nearest_side(&self, m: &Measurement, at: &Vec3) -> Option<Side> {
        let mut near: Vec<(f64, usize)> = Vec::new();
        self.cells.for_each_within(&self.cloud.points, at, self.search, |j, _| {
            near.extend(self.aside(m, at, j).map(|square| (square, j)));
        });
        let mut best: Option<Side> = None;
        for _ in 0..SIDES {
            let nearest = near.iter().min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let Some(&(_, first)) = nearest else { break };
            let axis = self.cloud.normals[first];
            let alike = |j: usize| self.cloud.normals[j].dot(&axis) >= ONE_SIDE;
            let side = self.side(at, near.iter().filter(|(_, j)| alike(*j)));
            near.retain(|(_, j)| !alike(*j));
            let better = best.as_ref().is_none_or(|b| side.height.abs() < b.height.abs());
            if better {
                best = Some(side);
            }
        }
        best
    }

    /// Square of the distance along the surface from the point `j` of the cloud, if that may be what was measured at `at`: the
    /// place is moved to the tangent plane along its normal or along the ray, on which the noise is.
    fn aside(&self, m: &Measurement, at: &Vec3, j: usize) -> Option<f64> {
        let normal = &self.cloud.normals[j];
        let offset = at - self.cloud.points[j];
        let (height, cosine) = (offset.dot(normal), m.ray.dot(normal));
        if cosine > BEHIND {
            return None;
        }
        let beneath = offset.norm_squared() - height * height;
        let square = if cosine < -FACING {
            beneath.min((offset - m.ray * (height / cosine)).norm_squared())
        } else {
            beneath
        };
        (square <= self.beside * self.beside).then_some(square)
    }

    /// One side beneath `at`, blended from the tangent planes of its points: the near ones count.
    fn side<'s>(&self, at: &Vec3, points: impl Iterator<Item = &'s (f64, usize)>) -> Side {
        let cloud = self.cloud;
        let (mut weights, mut height, mut normal, mut variance) = (0.0, 0.0, Vec3::zeros(), 0.0);
        for &(square, j) in points {
            let weight = (-2.0 * square / (self.spacing * self.spacing)).exp().max(1e-12);
            weights += weight;
            height += weight * (at - cloud.points[j]).dot(&cloud.normals[j]);
            normal += cloud.normals[j] * weight;
            variance += weight * cloud.sigma[j] * cloud.sigma[j];
        }
        Side { height: height / weights, normal: normal / weights, variance: variance / weights }
    }

    /// The measurement `height` (metres) above the side at `foot`, in its standard deviations there.
    fn held_against(&self, m: &Measurement, height: f64, foot: Vec3, side: &Side) -> Standing {
        let cosine = m.ray.dot(&side.normal);
        let stated = self.sensor.at(m.range, cosine).max(f64::from(LEAST_SIGMA));
        let sigma = stated * self.noise.correction.at(m.range, cosine);
        Standing {
            foot,
            normal: side.normal,
            height: height / sigma,
            surface: side.variance / (sigma * sigma),
        }
    }
}

/// One side of the surface near a place.
struct Side {
    /// Of the place above it, metres.
    height: f64,
    normal: Vec3,
    /// Of the surface, square metres.
    variance: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Scan;

    #[test]
    fn a_measurement_is_held_against_the_place_where_its_ray_meets_the_surface() {
        let sigma = 8e-4;
        // A cylinder of radius 20 mm about the y axis, seen along z.
        let (radius, mut cloud) = (0.02, Cloud::default());
        let normal = |a: f64| Vec3::new(a.sin(), 0.0, -a.cos());
        for i in -80..=80 {
            for j in -20..=20 {
                let n = normal(f64::from(i) * 0.02);
                cloud.push(n * radius + Vec3::y() * (f64::from(j) * 4e-4), n, 1e-5, 9);
            }
        }
        let points = (0..400).map(|i| [(i % 20) as f32 * 1e-3, (i / 20) as f32 * 1e-3, 0.3]);
        let scan = Scan { points: points.collect(), width: 20, origins: Vec::new() };
        let scan = PreparedScan::new(&scan).unwrap();
        let mut merged = Merged::new(&[(&scan, Pose::identity())], 4e-3);
        merged.sensor = NoiseModel::constant(sigma);
        merged.sigma.fill(sigma as f32);
        let noise = Learnt { correction: NoiseModel::constant(1.0), components: Components::WHITE };
        let explainer = Explainer::new(&cloud, &merged, 4e-3, 4e-4, &noise);
        let off = |cosine: f64, deviations: f64| {
            let hit = normal(-cosine.acos()) * radius;
            let point = hit - Vec3::z() * (deviations * sigma / cosine);
            let m = Measurement { point, ray: Vec3::z(), range: 0.3, source: 0, oriented: true };
            explainer.standing(&m).unwrap().off(&noise.components)
        };
        // The nearest point of the cylinder is 4.1 standard deviations away.
        assert!((off(0.35, 3.0) - 3.0).abs() < 0.05, "{}", off(0.35, 3.0));
        assert!((off(0.9, 3.0) - 3.0).abs() < 0.05, "{}", off(0.9, 3.0));
        assert!(off(0.35, 8.0) > 6.0, "{}", off(0.35, 8.0));
    }
}
