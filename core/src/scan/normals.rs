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
const MIN_SHARED_NEIGHBOURS: f64 = 8.0;
/// Beyond this angle of incidence (degrees) a "surface" is mostly flying points between two depths.
const MAX_INCIDENCE_DEG: f64 = 80.0;
/// Share of the planes, by noise, that are taken for smooth surface: a scan of ribs and steps has
/// no more.
const SMOOTH_SHARE: f64 = 0.25;
/// A plane that is noisier than smooth ones by this factor may reach round an edge. The noise of a
/// plane through thirty points is known to an eighth.
const MAX_NOISE_RATIO: f64 = 2.0;
/// A neighbour's plane must be less noisy by this factor. Where a bent surface turns away from the
/// sensor, noise grows from one plane to the next by less, and the less noisy one is no better: it
/// is that of another place. At an edge it grows tenfold.
const MIN_NOISE_GAIN: f64 = 3.0;
/// Standard deviations within which a plane of a neighbour holds a point: all but one in 400 of its
/// own.
const MAX_SHARED_SIGMAS: f64 = 3.0;
/// Standard deviations beyond which a point is an outlier of its plane: only one good point in
/// 16,000 is.
const MAX_PLANE_SIGMAS: f64 = 4.0;

/// A neighbourhood with more variance along the normal than this share of the least variance across
/// it is half as thick as it is wide: no surface.
const MAX_THICKNESS_RATIO: f64 = 0.25;
/// Parameters of a plane.
const PLANE_PARAMETERS: f64 = 3.0;
/// Room for the neighbours of a point, so that the list rarely has to grow.
const NEIGHBOUR_CAPACITY: usize = 64;

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
    /// The neighbourhoods of `points` (metres) within `radius` (metres).
    pub(super) fn new(points: &'a [Vec3], radius: f64) -> Self {
        Neighbourhood { points, cells: CellIndex::new(points, radius), radius }
    }

    /// The plane through the neighbours of a point; `None` if they are too few or no surface.
    pub(super) fn fit(&self, index: usize) -> Option<LocalFit> {
        let mut neighbours = Vec::with_capacity(NEIGHBOUR_CAPACITY);
        self.cells.for_each_within(self.points, &self.points[index], self.radius, |i, _| {
            neighbours.push(i)
        });
        let count = neighbours.len() as f64;
        if neighbours.len() < MIN_NEIGHBOURS {
            return None;
        }
        let fit = fit_plane(neighbours.iter().map(|&i| (self.points[i], 1.0)))?;
        if fit.variances[0] > MAX_THICKNESS_RATIO * fit.variances[1] {
            return None;
        }
        let noise = (fit.variances[0] * count / (count - PLANE_PARAMETERS)).sqrt();
        Some(LocalFit { normal: fit.normal, center: fit.center, noise, count })
    }

    /// Of the planes `fits` of the point's neighbours, the least noisy that holds it, if it is
    /// clearly less noisy than its `own`; `smooth` (metres) is the noise of planes that reach round
    /// no edge.
    fn find_smoother_plane(
        &self,
        index: usize,
        own: &LocalFit,
        fits: &[Option<LocalFit>],
        smooth: f64,
    ) -> Option<LocalFit> {
        let point = &self.points[index];
        let mut best = LocalFit { noise: own.noise / MIN_NOISE_GAIN, ..*own };
        let mut found = false;
        self.cells.for_each_within(self.points, point, self.radius, |i, _| {
            let Some(fit) = fits[i].filter(|fit| fit.count >= MIN_SHARED_NEIGHBOURS) else {
                return;
            };
            let holds = fit.distance(point) <= MAX_SHARED_SIGMAS * smooth.max(fit.noise);
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
pub(super) fn estimate_normals(
    near: &Neighbourhood,
    rays: &[Vec3],
    noise: f64,
) -> Vec<Option<PointNormals>> {
    let all = 0..near.points.len();
    let fits: Vec<Option<LocalFit>> = all.clone().into_par_iter().map(|i| near.fit(i)).collect();
    let smooth = smooth_noise(&fits).unwrap_or(noise);
    all.into_par_iter()
        .map(|i| {
            let own = fits[i]?;
            let at_edge = own.noise > MAX_NOISE_RATIO * smooth;
            let shared =
                if at_edge { near.find_smoother_plane(i, &own, &fits, smooth) } else { None };
            let (point, ray) = (&near.points[i], &rays[i]);
            let sharp = orient(&shared.unwrap_or(own), point, ray, noise)?;
            Some(PointNormals { sharp, smooth: orient(&own, point, ray, noise).unwrap_or(sharp) })
        })
        .collect()
}

/// The noise of planes that reach round no edge, metres.
fn smooth_noise(fits: &[Option<LocalFit>]) -> Option<f64> {
    let mut noises: Vec<f64> = fits.iter().flatten().map(|fit| fit.noise).collect();
    noises.sort_unstable_by(f64::total_cmp);
    noises.get((noises.len() as f64 * SMOOTH_SHARE) as usize).copied()
}

/// The normal of a plane, turned towards the sensor; none at grazing incidence, or if the point is
/// an outlier of the plane.
fn orient(fit: &LocalFit, point: &Vec3, ray: &Vec3, noise: f64) -> Option<Vec3> {
    let cosine = fit.normal.dot(ray);
    if cosine.abs() < MAX_INCIDENCE_DEG.to_radians().cos() {
        return None;
    }
    if fit.distance(point) > MAX_PLANE_SIGMAS * noise.max(fit.noise) {
        return None;
    }
    Some(if cosine > 0.0 { -fit.normal } else { fit.normal })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    const SPACING: f64 = 1e-3;
    const RADIUS: f64 = 3e-3;
    const NOISE: f64 = 2e-5;

    /// A grid of 60 x 30 points whose height above z = 0 is `height(x)` and whose noise is
    /// `sigma(x)`, metres.
    fn grid(height: fn(f64) -> f64, sigma: fn(f64) -> f64) -> Vec<Vec3> {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        (0..60 * 30)
            .map(|i| {
                let (x, y) = (f64::from(i % 60) * SPACING, f64::from(i / 60) * SPACING);
                let deviate: f64 = rng.sample(StandardNormal);
                Vec3::new(x, y, height(x) + sigma(x) * deviate)
            })
            .collect()
    }

    /// Normals of points that a distant sensor sees from above.
    fn normals_from_above(points: &[Vec3]) -> Vec<PointNormals> {
        let near = Neighbourhood::new(points, RADIUS);
        let rays = vec![-Vec3::z(); points.len()];
        estimate_normals(&near, &rays, NOISE).into_iter().flatten().collect()
    }

    #[test]
    fn where_noise_grows_along_a_flat_surface_no_point_takes_another_plane() {
        // Noise grows by a factor of 1.4 over a radius, and by 200 over the grid. The noisier
        // points are far above the noise of the smooth quarter, and all planes hold their
        // neighbours' points.
        let points = grid(|_| 0.0, |x| 1e-6 * (x / 0.011).exp());
        let normals = normals_from_above(&points);
        assert!(normals.len() > 1500, "{}", normals.len());
        for normal in &normals {
            assert_eq!(normal.sharp, normal.smooth);
        }
    }

    #[test]
    fn near_a_ridge_points_take_the_plane_of_their_own_face() {
        let points = grid(|x| -(x - 0.0295).abs(), |_| NOISE);
        let near = Neighbourhood::new(&points, RADIUS);
        let normals = estimate_normals(&near, &vec![-Vec3::z(); points.len()], NOISE);
        let mut angles = [Vec::new(), Vec::new()];
        for (point, normals) in points.iter().zip(&normals) {
            let Some(normals) = normals else { continue };
            // In a radius of the ridge, but not of the grid's border.
            if (point.x - 0.0295).abs() < 2e-3 && (5e-3..24e-3).contains(&point.y) {
                let face = Vec3::new((point.x - 0.0295).signum(), 0.0, 1.0).normalize();
                for (angles, normal) in angles.iter_mut().zip([normals.sharp, normals.smooth]) {
                    angles.push(normal.dot(&face).clamp(-1.0, 1.0).acos().to_degrees());
                }
            }
        }
        let [sharp, smooth] = angles;
        assert!(sharp.len() > 50, "{}", sharp.len());
        let count = sharp.len() as f64;
        let (mean_sharp, mean_smooth) =
            (sharp.iter().sum::<f64>() / count, smooth.iter().sum::<f64>() / count);
        assert!(mean_sharp < 3.0 && mean_smooth > 15.0, "{mean_sharp} {mean_smooth}");
    }

    #[test]
    fn a_plane_is_borrowed_only_if_it_is_three_times_less_noisy_and_holds_the_point() {
        let points: Vec<Vec3> = (0..3).map(|i| Vec3::x() * (f64::from(i) * SPACING)).collect();
        let near = Neighbourhood::new(&points, RADIUS);
        let own = LocalFit { normal: Vec3::z(), center: points[0], noise: 3e-4, count: 20.0 };
        let tilted = Vec3::new(0.05, 0.0, 1.0).normalize();
        for (noise, count, height, expected) in [
            (0.99e-4, 20.0, 0.0, true),
            (1.01e-4, 20.0, 0.0, false),
            (0.99e-4, 7.0, 0.0, false),
            (0.99e-4, 20.0, 4e-4, false),
        ] {
            let center = points[1] + Vec3::z() * height;
            let other = LocalFit { normal: tilted, center, noise, count };
            let fits = [Some(own), Some(other), None];
            let found = near.find_smoother_plane(0, &own, &fits, 2e-5);
            assert_eq!(found.map(|fit| fit.normal), expected.then_some(tilted), "{noise} {count}");
        }
    }
}
