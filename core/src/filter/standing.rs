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

    /// `None` if no point of the cloud is beside the measurement.
    pub(super) fn standing(&self, m: &Measurement) -> Option<Standing> {
        let mut near: Vec<(f64, usize)> = Vec::new();
        self.cells.for_each_within(&self.cloud.points, &m.point, self.search, |j, _| {
            near.extend(self.aside(m, j).map(|square| (square, j)));
        });
        let mut best: Option<Standing> = None;
        for _ in 0..SIDES {
            let nearest = near.iter().min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let Some(&(_, first)) = nearest else { break };
            let axis = self.cloud.normals[first];
            let alike = |j: usize| self.cloud.normals[j].dot(&axis) >= ONE_SIDE;
            let standing = self.above(m, near.iter().filter(|(_, j)| alike(*j)));
            near.retain(|(_, j)| !alike(*j));
            let better = best.as_ref().is_none_or(|b| standing.height.abs() < b.height.abs());
            if better {
                best = Some(standing);
            }
        }
        best
    }

    /// Square of the distance along the surface from the point `j` of the cloud, if that may be what was measured: the
    /// measurement is moved to the tangent plane along its normal or along the ray, on which the noise is.
    fn aside(&self, m: &Measurement, j: usize) -> Option<f64> {
        let normal = &self.cloud.normals[j];
        let offset = m.point - self.cloud.points[j];
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

    /// Above one side, blended from the tangent planes of its points: the near ones count.
    fn above<'s>(&self, m: &Measurement, side: impl Iterator<Item = &'s (f64, usize)>) -> Standing {
        let cloud = self.cloud;
        let (mut weights, mut height, mut normal, mut variance) = (0.0, 0.0, Vec3::zeros(), 0.0);
        for &(square, j) in side {
            let weight = (-2.0 * square / (self.spacing * self.spacing)).exp().max(1e-12);
            weights += weight;
            height += weight * (m.point - cloud.points[j]).dot(&cloud.normals[j]);
            normal += cloud.normals[j] * weight;
            variance += weight * cloud.sigma[j] * cloud.sigma[j];
        }
        let normal = normal / weights;
        let (height, cosine) = (height / weights, m.ray.dot(&normal));
        let stated = self.sensor.at(m.range, cosine).max(f64::from(LEAST_SIGMA));
        let sigma = stated * self.noise.correction.at(m.range, cosine);
        Standing {
            foot: m.point - normal * height,
            normal,
            height: height / sigma,
            surface: variance / weights / (sigma * sigma),
        }
    }
}
