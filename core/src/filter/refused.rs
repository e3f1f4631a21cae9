//! Which measurements the filtered cloud does not explain.

use super::learnt::Learnt;
use super::merged::{LEAST_SIGMA, Merged};
use crate::geometry::{Cloud, NoiseModel, Pose, Vec3};
use crate::register::PreparedScan;
use crate::voxel::CellIndex;
use rayon::prelude::*;

/// Standard deviations within which a measurement belongs to a surface: one good one in 16,000 lies beyond.
const REACH: f64 = 4.0;
/// Along the surface, a point of the cloud speaks for this many noise radii around.
const BESIDE: f64 = 0.75;
/// A surface is not measured from behind; normals are uncertain by some degrees.
const BEHIND: f64 = 0.1;

/// Cosine from which on a ray surely meets the surface near by. At a more grazing angle it may pass over it.
const FACING: f64 = 0.4;

/// One measurement, object frame.
struct Measurement<'a> {
    point: Vec3,
    ray: Vec3,
    range: f64,
    /// Of its scan.
    model: &'a NoiseModel,
}

/// The raw points of each scan that belong to no point of `cloud`, ascending.
pub(super) fn refused(
    scans: &[(&PreparedScan, Pose)],
    merged: &Merged,
    cloud: &Cloud,
    noise_radius: f64,
    noise: &Learnt,
) -> Vec<Vec<u32>> {
    let total = noise.components.total().sqrt();
    let largest = merged.sigma.iter().copied().fold(LEAST_SIGMA, f32::max);
    let beside = BESIDE * noise_radius;
    let search = beside + 1.5 * REACH * total * f64::from(largest);
    let cells = CellIndex::new(&cloud.points, search);
    let explainer =
        Explainer { cells, cloud, beside, search, total, correction: &noise.correction };
    let mut refused = Vec::with_capacity(scans.len());
    for (scan, pose) in scans {
        let lost = |point: &Vec3, ray: &Vec3, range: f32| {
            !explainer.explains(&Measurement {
                point: pose.rotation * point + pose.translation.vector,
                ray: pose.rotation * ray,
                range: f64::from(range),
                model: &scan.model,
            })
        };
        let oriented = (0..scan.points.len()).into_par_iter();
        let oriented = oriented.filter(|&i| lost(&scan.points[i], &scan.rays[i], scan.range[i]));
        let mut found: Vec<u32> = oriented.map(|i| scan.source[i]).collect();
        let aside = scan.aside.par_iter().filter(|a| lost(&a.point, &a.ray, a.range));
        found.extend(aside.map(|a| a.source).collect::<Vec<u32>>());
        found.sort_unstable();
        refused.push(found);
    }
    refused
}

struct Explainer<'a> {
    cloud: &'a Cloud,
    cells: CellIndex,
    /// Along the surface, metres.
    beside: f64,
    /// In all, metres.
    search: f64,
    /// Standard deviation of a measurement in corrected ones.
    total: f64,
    correction: &'a NoiseModel,
}

impl Explainer<'_> {
    fn explains(&self, m: &Measurement) -> bool {
        let cloud = self.cloud;
        let mut explained = false;
        self.cells.for_each_within(&cloud.points, &m.point, self.search, |j, _| {
            if explained {
                return;
            }
            let normal = &cloud.normals[j];
            let offset = m.point - cloud.points[j];
            let (height, cosine) = (offset.dot(normal), m.ray.dot(normal));
            if cosine > BEHIND || !self.is_beside(&offset, height, m, cosine) {
                return;
            }
            let stated = m.model.at(m.range, cosine).max(f64::from(LEAST_SIGMA));
            let sigma = stated * self.correction.at(m.range, cosine) * self.total;
            explained = height.abs() <= REACH * sigma.hypot(cloud.sigma[j]);
        });
        explained
    }

    /// Whether the measurement, moved to the tangent plane along its normal or along the ray, on which the noise is, comes
    /// near to the point.
    fn is_beside(&self, offset: &Vec3, height: f64, m: &Measurement, cosine: f64) -> bool {
        let square = self.beside * self.beside;
        offset.norm_squared() - height * height <= square
            || (cosine < -FACING && (offset - m.ray * (height / cosine)).norm_squared() <= square)
    }
}
