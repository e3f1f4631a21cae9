//! What all scans measured of the common surface, and the weighted equations that follow from it.

use super::correlation::{Correlation, Residuals};
use super::equations::{Row, reduced_equations};
use super::resolution::Resolution;
use super::shrinkage::{InformationShrinkage, PatchView, SharedNoise, height_derivative};
use super::surfels::{SurfelMeasurement, SurfelPoint, Surfels, measure};
use super::variances::{Variances, deviations, mean_heights, point_sigma};
use super::whitening::{WhiteRow, whiten};
use crate::Result;
use crate::geometry::{Mat6, Pose, Twist, Vec3, median};
use crate::register::params::RegisterParams;
use crate::register::registration_scan::RegistrationScan;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Noise where no scan states any, metres.
const DEFAULT_NOISE_M: f64 = 1e-6;
/// Residuals are believed to be as small as this share of the scans' stated noise, but not smaller.
const MIN_NOISE_RATIO: f64 = 0.5;

/// All scans' measurements of the common surface.
pub(super) struct SurfaceMeasurements {
    surfels: Surfels,
    /// One list a scan; residuals are relative to the mean height of their surfel.
    by_scan: Vec<Vec<SurfelMeasurement>>,
    /// Number of measurements of surfels that other scans measured too.
    redundant: usize,
    /// Robust standard deviation of a point about the surface, metres.
    point_sigma: f64,
    variances: Variances,
    /// The weight of a measurement beside the priors, and the noise that it shares with its
    /// neighbours.
    information_share: f64,
    correlation: Correlation,
    /// Radius of the neighbourhood that a point's normal is fitted to, metres.
    normal_radius: f64,
}

impl SurfaceMeasurements {
    /// Covers the surface of `scans` at `poses` with surfels and measures their heights.
    pub(super) fn new(
        scans: &[&RegistrationScan],
        poses: &[Pose],
        resolution: Resolution,
        params: &RegisterParams,
    ) -> SurfaceMeasurements {
        let min_normal_cos = params.max_normal_angle.cos();
        let views: Vec<(&RegistrationScan, Pose)> =
            scans.iter().copied().zip(poses.iter().copied()).collect();
        let surfels = Surfels::new(&views, resolution.spacing, min_normal_cos);
        let noise = median(scans.iter().map(|s| s.noise).collect()).unwrap_or(DEFAULT_NOISE_M);
        let noise_floor = noise * MIN_NOISE_RATIO;
        let points: Vec<Vec<SurfelPoint>> = views
            .par_iter()
            .map(|(scan, pose)| surfels.match_points(scan, pose, resolution.reach, min_normal_cos))
            .collect();
        let count = surfels.centers.len();
        // The first pass counts everything in reach, to estimate how large the residuals are.
        let everything = measure_all(&points, resolution.reach);
        let point_sigma = point_sigma(&everything, count).max(noise_floor);
        let mut by_scan = measure_all(&points, point_sigma);
        let heights = mean_heights(&by_scan, count);
        let variances = Variances::estimate(&by_scan, &heights, noise_floor);
        let redundant = deviations(&by_scan, &heights).count();
        for measurement in by_scan.iter_mut().flatten() {
            measurement.residual -= heights[measurement.surfel as usize].height;
        }
        let normal_radius = median(scans.iter().map(|s| s.normal_radius).collect()).unwrap_or(0.0);
        SurfaceMeasurements {
            surfels,
            by_scan,
            redundant,
            point_sigma,
            variances,
            information_share: params.information_share,
            correlation: Correlation::NONE,
            normal_radius,
        }
    }

    /// Estimates from the residuals what neighbouring measurements share of their noise. From then
    /// on the equations are white and count fully; before, `information_share` stands for it.
    pub(super) fn estimate_correlation(&mut self) {
        let residuals: Vec<Residuals> =
            self.by_scan.iter().map(|scan| self.normalised_residuals(scan)).collect();
        self.correlation = Correlation::estimate(&residuals, self.surfels.spacing);
        self.information_share = 1.0;
    }

    /// The inverse of a measurement's standard deviation, 1 / metres.
    fn precision(&self, measurement: &SurfelMeasurement) -> f64 {
        (self.information_share / self.variances.of_mean(measurement.weight)).sqrt()
    }

    fn normalised_residuals(&self, scan: &[SurfelMeasurement]) -> Residuals {
        let values = scan.iter().map(|m| m.residual * self.precision(m)).collect();
        Residuals { positions: lateral_positions(scan), values }
    }

    /// Hessian and gradient of the geometry's half squared error by the poses.
    ///
    /// # Errors
    /// [`crate::Error::Input`] if the measurements do not determine the surfels' heights.
    pub(super) fn normal_equations(&self) -> Result<(DMatrix<f64>, DVector<f64>)> {
        let rows: Vec<Vec<Row>> =
            self.by_scan.par_iter().map(|scan| self.whitened_rows(scan)).collect();
        reduced_equations(&rows, self.surfels.centers.len())
    }

    /// How far the information of the geometry has to be shrunk; `None` if the prior is not finite.
    pub(super) fn shrinkage(&self, poses: &[Pose], prior: &Mat6) -> Option<InformationShrinkage> {
        let normals = self.correlation.of_fitted_normals(self.normal_radius);
        let noise = SharedNoise {
            height_share: self.correlation.share,
            independent_normals: normals.independent_share(self.surfels.spacing),
        };
        InformationShrinkage::new(&self.patch_views(), poses, prior, noise)
    }

    /// What each scan saw of each surfel, ordered by surfel.
    fn patch_views(&self) -> Vec<PatchView> {
        let mut views = Vec::new();
        for (scan, measurements) in self.by_scan.iter().enumerate() {
            views.extend(measurements.iter().map(|measurement| {
                let surfel = measurement.surfel as usize;
                let center = &self.surfels.centers[surfel];
                PatchView {
                    surfel: measurement.surfel,
                    scan,
                    weight: self.precision(measurement).powi(2),
                    own: height_derivative(&measurement.normal, center),
                    shared: height_derivative(&self.surfels.normals[surfel], center),
                }
            }));
        }
        views.sort_by_key(|view| (view.surfel, view.scan));
        views
    }

    /// The equations of one scan, whose noise is white and of unit variance.
    fn whitened_rows(&self, scan: &[SurfelMeasurement]) -> Vec<Row> {
        let white_rows = whiten(&lateral_positions(scan), &self.correlation);
        white_rows.into_iter().map(|white| self.combined_row(scan, &white)).collect()
    }

    /// The linear combination of a scan's equations that `white` asks for.
    fn combined_row(&self, scan: &[SurfelMeasurement], white: &WhiteRow) -> Row {
        let mut row = Row { jacobian: Twist::zeros(), residual: 0.0, heights: Vec::new() };
        for &(index, coefficient) in &white.terms {
            let measurement = &scan[index];
            let factor = coefficient * self.precision(measurement);
            row.jacobian += measurement.jacobian * factor;
            row.residual += measurement.residual * factor;
            row.heights.push((measurement.surfel, factor));
        }
        row
    }
}

/// Every scan's measurements of the surfels, with residuals of standard deviation `sigma` (metres).
fn measure_all(points: &[Vec<SurfelPoint>], sigma: f64) -> Vec<Vec<SurfelMeasurement>> {
    points.par_iter().map(|scan| measure(scan, sigma)).collect()
}

/// Positions of a scan's measurements across its line of sight, metres.
fn lateral_positions(scan: &[SurfelMeasurement]) -> Vec<Vec3> {
    let ray = scan.iter().map(|m| m.position).sum::<Vec3>().try_normalize(0.0);
    let ray = ray.unwrap_or_else(Vec3::z);
    scan.iter().map(|m| m.position - ray * ray.dot(&m.position)).collect()
}

/// Root mean square point-to-plane distance between scans, metres, estimated robustly from the
/// median absolute distance; none if no two of them overlap.
pub(crate) fn rms_residual(
    scans: &[&RegistrationScan],
    poses: &[Pose],
    params: &RegisterParams,
) -> Option<f64> {
    if scans.len() < 2 {
        return None;
    }
    let found = SurfaceMeasurements::new(scans, poses, Resolution::finest(scans), params);
    if found.redundant == 0 {
        return None;
    }
    // The errors of both scans lie between two points.
    Some(found.point_sigma * std::f64::consts::SQRT_2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{exp, transform};
    use crate::register::sharp_shapes_tests::{even_views, perturbed, shape, simulate_scan};
    use crate::register::strategy::Strategy;
    use crate::scan::{PoseSigma, PreparedScan};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    const SIGMA: PoseSigma = PoseSigma { translation: 1e-3, rotation: 3e-3 };
    const STEP: f64 = 1e-6;

    /// Three views of a wedge, and poses that are not exact.
    fn views() -> (Vec<RegistrationScan>, Vec<Pose>) {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let truth = even_views(12);
        let strategy = Strategy::new(&RegisterParams::default());
        let scans = truth[..3].iter().map(|pose| {
            let scan = simulate_scan(&shape("wedge"), pose, 2e-3, 1e-4, &mut rng);
            RegistrationScan::new(&PreparedScan::new(&scan).unwrap(), SIGMA, &strategy)
        });
        (scans.collect(), perturbed(&truth[..3], SIGMA.translation, SIGMA.rotation, 1))
    }

    fn measured(scans: &[RegistrationScan], poses: &[Pose]) -> SurfaceMeasurements {
        let scans: Vec<&RegistrationScan> = scans.iter().collect();
        let resolution = Resolution { spacing: 6e-3, reach: 6e-3 };
        SurfaceMeasurements::new(&scans, poses, resolution, &RegisterParams::default())
    }

    /// Half squared error of the measurements of `found`, which were made at `poses`, if the scans
    /// are at `moved` and each surfel at its best height.
    fn half_squared_error(found: &SurfaceMeasurements, poses: &[Pose], moved: &[Pose]) -> f64 {
        let mut sums = vec![[0.0; 3]; found.surfels.centers.len()];
        for ((scan, pose), moved) in found.by_scan.iter().zip(poses).zip(moved) {
            for m in scan {
                let surfel = m.surfel as usize;
                let motion = transform(moved, &m.position) - transform(pose, &m.position);
                let residual = m.residual + found.surfels.normals[surfel].dot(&motion);
                let weight = found.precision(m).powi(2);
                let [w, wr, wrr] = &mut sums[surfel];
                *w += weight;
                *wr += weight * residual;
                *wrr += weight * residual * residual;
            }
        }
        let errors = sums.iter().filter(|[w, ..]| *w > 0.0).map(|[w, wr, wrr]| wrr - wr * wr / w);
        0.5 * errors.sum::<f64>()
    }

    #[test]
    fn the_gradient_agrees_with_finite_differences() {
        let (scans, poses) = views();
        let found = measured(&scans, &poses);
        assert!(found.redundant > 100, "{}", found.redundant);
        let (_, gradient) = found.normal_equations().unwrap();
        for k in 0..3 {
            for i in 0..6 {
                let [up, down] = [STEP, -STEP].map(|step| {
                    let mut moved = poses.clone();
                    moved[k] *= exp(&Twist::from_fn(|j, _| if i == j { step } else { 0.0 }));
                    half_squared_error(&found, &poses, &moved)
                });
                let (expected, actual) = ((up - down) / (2.0 * STEP), gradient[6 * k + i]);
                assert!((actual - expected).abs() < 1e-4 * gradient.amax(), "{k} {i}: {expected}");
            }
        }
    }

    #[test]
    fn a_motion_of_all_scans_together_changes_nothing() {
        let (scans, poses) = views();
        let (hessian, gradient) = measured(&scans, &poses).normal_equations().unwrap();
        for i in 0..6 {
            // The same motion of the object frame, as twists of the scans' frames.
            let axis = Twist::from_fn(|j, _| f64::from(i == j));
            let mut motion = DVector::zeros(18);
            for (k, pose) in poses.iter().enumerate() {
                let twist = crate::geometry::adjoint(&pose.inverse()) * axis;
                motion.fixed_rows_mut::<6>(6 * k).copy_from(&twist);
            }
            let scale = motion.norm();
            assert!(gradient.dot(&motion).abs() < 1e-2 * gradient.amax() * scale, "{i}");
            let stiffness = motion.dot(&(&hessian * &motion)) / (scale * scale);
            assert!(stiffness < 1e-2 * hessian.diagonal().max(), "{i}: {stiffness}");
        }
    }

    #[test]
    fn the_rms_residual_is_that_of_two_scans_noise() {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let pose = even_views(12)[0];
        let strategy = Strategy::new(&RegisterParams::default());
        let scans = [0, 1].map(|_| {
            let scan = simulate_scan(&shape("wedge"), &pose, 2e-3, 2e-4, &mut rng);
            RegistrationScan::new(&PreparedScan::new(&scan).unwrap(), SIGMA, &strategy)
        });
        let params = RegisterParams::default();
        let found = rms_residual(&[&scans[0], &scans[1]], &[pose, pose], &params).unwrap();
        // Noise along the rays is noise along the normals times the cosine of the incidence.
        assert!((1.0e-4..3.0e-4).contains(&found), "{found}");
        assert!(rms_residual(&[&scans[0]], &[pose], &params).is_none());
        let far = Pose::translation(1.0, 0.0, 0.0) * pose;
        assert!(rms_residual(&[&scans[0], &scans[1]], &[pose, far], &params).is_none());
    }
}
