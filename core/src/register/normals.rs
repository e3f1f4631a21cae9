//! Normals of a scan that do not reach round edges.
//!
//! The plane through all points near an edge is tilted by what the scan sees of the other face, so
//! that the normals of each scan are wrong in their own way. Such a plane is noisier than the
//! others. Its point takes the least noisy plane of its neighbours that holds it instead: the one
//! of a neighbour that is farther from the edge (a shifted window; Kuwahara, Hachimura, Eiho &
//! Kinoshita 1976, for images).

use crate::geometry::{Vec3, fit_plane};
use crate::voxel::CellIndex;
use rayon::prelude::*;

/// Fewer neighbours than this support no plane.
const MIN_NEIGHBOURS: usize = 6;
/// Fewer neighbours than this support no plane for others: with three parameters fitted, the noise
/// of so few is known to a third.
const MIN_LENT_NEIGHBOURS: f64 = 8.0;
/// Beyond this angle of incidence (degrees) a "surface" is mostly flying points between two depths.
const GRAZING: f64 = 80.0;
/// Share of the planes, by noise, that are taken for smooth surface: a scan of ribs and steps has
/// no more.
const SMOOTH_SHARE: f64 = 0.25;
/// A plane that is noisier than smooth ones by this factor may reach round an edge. The noise of a
/// plane through thirty points is known to an eighth.
const MAX_NOISE_RATIO: f64 = 2.0;
/// A neighbour's plane must be less noisy by this factor. Where a bent surface turns away from the
/// sensor, noise grows from one plane to the next by less, and the less noisy one is no better: it
/// is that of another place. At an edge it grows tenfold.
const MIN_GAIN: f64 = 3.0;
/// Standard deviations within which a plane of a neighbour holds a point: all but one in 400 of its
/// own.
const MAX_LENT_DISTANCE: f64 = 3.0;
/// Standard deviations beyond which a point is an outlier of its plane: only one good point in
/// 16,000 is.
const MAX_DISTANCE: f64 = 4.0;

/// The points of a scan and the radius (metres) of their planes.
pub(super) struct Neighbourhood<'a> {
    points: &'a [Vec3],
    cells: CellIndex,
    radius: f64,
}

/// The plane through a point's neighbours.
#[derive(Clone, Copy)]
pub(super) struct LocalFit {
    /// Unit normal to either side.
    pub normal: Vec3,
    /// Mean of the neighbours, metres.
    pub center: Vec3,
    /// Standard deviation of the neighbours about it, metres.
    pub noise: f64,
    /// Number of neighbours.
    pub count: f64,
}

impl LocalFit {
    /// Distance of a point, metres.
    fn distance(&self, point: &Vec3) -> f64 {
        (point - self.center).dot(&self.normal).abs()
    }
}

impl<'a> Neighbourhood<'a> {
    /// Of `points` (metres), within `radius` (metres).
    pub(super) fn new(points: &'a [Vec3], radius: f64) -> Self {
        Neighbourhood { points, cells: CellIndex::new(points, radius), radius }
    }

    /// The plane through the neighbours of a point; `None` if they are too few or no surface.
    pub(super) fn fit(&self, index: usize) -> Option<LocalFit> {
        let mut neighbours = Vec::with_capacity(64);
        self.cells.for_each_within(self.points, &self.points[index], self.radius, |i, _| {
            neighbours.push(i)
        });
        let count = neighbours.len() as f64;
        if neighbours.len() < MIN_NEIGHBOURS {
            return None;
        }
        let fit = fit_plane(neighbours.iter().map(|&i| (self.points[i], 1.0)))?;
        // A neighbourhood as thick as it is wide is no surface.
        if fit.variances[0] > 0.25 * fit.variances[1] {
            return None;
        }
        let noise = (fit.variances[0] * count / (count - 3.0)).sqrt();
        Some(LocalFit { normal: fit.normal, center: fit.center, noise, count })
    }

    /// Of the planes `fits` of the point's neighbours, the least noisy that holds it, if it is
    /// clearly less noisy than its `own`; `smooth` (metres) is the noise of planes that reach round
    /// no edge.
    fn lent(
        &self,
        index: usize,
        own: &LocalFit,
        fits: &[Option<LocalFit>],
        smooth: f64,
    ) -> Option<LocalFit> {
        let point = &self.points[index];
        let mut best = LocalFit { noise: own.noise / MIN_GAIN, ..*own };
        let mut found = false;
        self.cells.for_each_within(self.points, point, self.radius, |i, _| {
            let Some(fit) = fits[i].filter(|fit| fit.count >= MIN_LENT_NEIGHBOURS) else { return };
            let holds = fit.distance(point) <= MAX_LENT_DISTANCE * smooth.max(fit.noise);
            if holds && fit.noise < best.noise {
                (best, found) = (fit, true);
            }
        });
        found.then_some(best)
    }
}

/// The unit normals of one point, towards the sensor.
#[derive(Clone, Copy)]
pub(super) struct PointNormals {
    /// That of a plane that does not reach round an edge.
    pub sharp: Vec3,
    /// That of the plane through all neighbours, which rounds edges off.
    pub smooth: Vec3,
}

/// Normals of the points that the sensor sees along the unit vectors `rays`; none for points that
/// are off their plane or at grazing incidence. `noise` (metres) is that of most planes.
pub(super) fn normals(
    near: &Neighbourhood,
    rays: &[Vec3],
    noise: f64,
) -> Vec<Option<PointNormals>> {
    let all = 0..near.points.len();
    let fits: Vec<Option<LocalFit>> = all.clone().into_par_iter().map(|i| near.fit(i)).collect();
    let smooth = smooth_noise(&fits).unwrap_or(noise);
    let normal = |i: usize| {
        let own = fits[i]?;
        let towards_sensor = |fit: &LocalFit| oriented(fit, &near.points[i], &rays[i], noise);
        let edge = own.noise > MAX_NOISE_RATIO * smooth;
        let lent = if edge { near.lent(i, &own, &fits, smooth) } else { None };
        let sharp = towards_sensor(&lent.unwrap_or(own))?;
        Some(PointNormals { sharp, smooth: towards_sensor(&own).unwrap_or(sharp) })
    };
    all.into_par_iter().map(normal).collect()
}

/// The noise of planes that reach round no edge, metres.
fn smooth_noise(fits: &[Option<LocalFit>]) -> Option<f64> {
    let mut noises: Vec<f64> = fits.iter().flatten().map(|fit| fit.noise).collect();
    noises.sort_unstable_by(f64::total_cmp);
    noises.get((noises.len() as f64 * SMOOTH_SHARE) as usize).copied()
}

fn oriented(fit: &LocalFit, point: &Vec3, ray: &Vec3, noise: f64) -> Option<Vec3> {
    let cosine = fit.normal.dot(ray);
    if cosine.abs() < GRAZING.to_radians().cos() {
        return None;
    }
    if fit.distance(point) > MAX_DISTANCE * noise.max(fit.noise) {
        return None;
    }
    Some(if cosine > 0.0 { -fit.normal } else { fit.normal })
}
