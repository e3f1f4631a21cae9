//! Which directions of motion two scans determine, beyond what their noise pretends.
//!
//! The information of point-to-plane residuals is a sum of J J^T, where J depends on the normal.
//! Noise of the normals, d, adds E[d d^T] to it in every direction, also in those which the surface
//! leaves free: a cylinder seems to determine its rotation about its axis. The two scans measured
//! the normals independently, so that
//!
//! ```text
//! H = s / sigma^2 sum_i w_i (J_i K_i^T + K_i J_i^T) / 2          (1)
//! ```
//!
//! with J from the scan's normals and K from the map's has the expectation which noise-free normals
//! give. Here sigma is the residuals' own spread and s the share of the measurements that is
//! independent in spite of the noise which neighbours share (`correlation`). Directions are
//! compared by how far they move the points: with M the sum of the squared displacements,
//!
//! ```text
//! C v = lambda M v,     C = sum_i w_i (J_i K_i^T + K_i J_i^T) / 2                 (2)
//! ```
//!
//! A direction in which (2) does not exceed its own standard error is unobservable; along it the
//! prior alone decides (solution remapping; Zhang, Kaess & Singh 2016, On Degeneracy of
//! Optimization-based State Estimation Problems).

use crate::geometry::{Mat6, Pose, Twist, Vec3, exp, log, median, transform};
use crate::register::align::factors::{MAD_PER_SIGMA, point_motion, point_to_plane, tukey};
use crate::register::align::{Map, Prior};
use crate::register::joint::{Correlation, Residuals};
use crate::register::params::RegisterParams;
use crate::register::registration_scan::RegistrationScan;
use nalgebra::{DMatrix, SymmetricEigen};
use rayon::prelude::*;

/// The information on a direction must exceed zero by this many standard errors.
const SIGNIFICANCE_SIGMA: f64 = 2.0;
/// Independent measurements that a scan counts for, at most. Noise that changes slowly over a scan
/// (the drift of a sweep, a matcher's bias on slopes) moves it as a whole: the alignment follows
/// it, so that residuals do not show it.
const MAX_INDEPENDENT_MEASUREMENTS: f64 = 12.0;
/// Points of a scan that are evaluated, at most: more add nothing, because neighbours share their
/// noise.
const MAX_POINTS: usize = 1000;
/// The residuals' spread is taken to be at least this share of the scan's stated noise: a smaller
/// one is chance.
const MIN_SPREAD_RATIO: f64 = 0.3;

/// A point of the scan on the map.
struct Match {
    /// Sensor frame, metres.
    point: Vec3,
    /// Metres.
    residual: f64,
    /// Robust weight.
    weight: f64,
    /// Derivative of the residual by the pose, with the scan's normal: J of (1).
    own: Twist,
    /// The same with the map's normal: K of (1).
    other: Twist,
}

/// What the geometry determines of a pose.
pub(crate) struct Observability {
    /// Information beyond the normals' noise; zero along unobservable directions.
    pub information: Mat6,
    /// Motions that the surface leaves free, normalised as in (2): v^T M v = 1.
    unobservable: Vec<Twist>,
}

impl Observability {
    /// Evaluates the points of `scan` within `reach` (metres) of the map at `pose`; `None` if they
    /// are too few.
    pub(crate) fn evaluate(
        scan: &RegistrationScan,
        map: &Map,
        pose: &Pose,
        reach: f64,
        params: &RegisterParams,
    ) -> Option<Observability> {
        let mut matches = find_matches(scan, map, pose, reach, params.max_normal_angle.cos());
        let mad = median(matches.iter().map(|m| m.residual.abs()).collect())?;
        let spread = (mad / MAD_PER_SIGMA).max(MIN_SPREAD_RATIO * scan.noise);
        // Which points lie on the surface is decided by the stated noise of scan and map, how well
        // they lie there by their own.
        let width = spread.max(std::f64::consts::SQRT_2 * scan.noise);
        for m in &mut matches {
            m.weight = tukey(m.residual / width);
        }
        matches.retain(|m| m.weight > 0.0);
        let count = matches.len() as f64;
        let spacing = scan.extent / count.sqrt();
        let residuals = matches.iter().map(|m| m.residual).collect();
        let share = independent_share(&matches, residuals, spacing)
            .min(MAX_INDEPENDENT_MEASUREMENTS / count);
        let directions = Directions::from_matches(&matches)?;
        let mut observability =
            Observability { information: Mat6::zeros(), unobservable: Vec::new() };
        for v in &directions.vectors {
            let sums = DirectionSums::new(&matches, v);
            if sums.is_observable(&matches, v, spacing) {
                let covector = directions.metric * v;
                let scale = sums.information * share / (spread * spread);
                observability.information += covector * covector.transpose() * scale; // (1)
            } else {
                observability.unobservable.push(*v);
            }
        }
        Some(observability)
    }

    /// `pose`, moved along the unobservable directions to where `prior` is most probable.
    pub(crate) fn remap_to_prior(&self, pose: &Pose, prior: &Prior) -> Pose {
        if self.unobservable.is_empty() {
            return *pose;
        }
        let basis = DMatrix::from_fn(6, self.unobservable.len(), |r, c| self.unobservable[c][r]);
        let correction = log(&(prior.pose.inverse() * pose));
        let information = basis.transpose() * prior.information * &basis;
        let Some(solver) = information.cholesky() else { return *pose };
        let step = -&basis * solver.solve(&(basis.transpose() * (prior.information * correction)));
        pose * exp(&step.fixed_rows::<6>(0).into_owned())
    }
}

/// The points of the scan within `reach` of the map whose normals agree, with unit weights.
fn find_matches(
    scan: &RegistrationScan,
    map: &Map,
    pose: &Pose,
    reach: f64,
    min_normal_cos: f64,
) -> Vec<Match> {
    let stride = scan.points.len().div_ceil(MAX_POINTS).max(1);
    (0..scan.points.len())
        .into_par_iter()
        .step_by(stride)
        .filter_map(|i| {
            let point = scan.points[i];
            let target = map.nearest_within(&transform(pose, &point), reach)?;
            let normal = pose.rotation * scan.normals[i];
            if target.normal.dot(&normal) < min_normal_cos {
                return None;
            }
            let (a, own) = point_to_plane(pose, &point, &target.point, &normal);
            let (b, other) = point_to_plane(pose, &point, &target.point, &target.normal);
            Some(Match { point, residual: (a + b) / 2.0, weight: 1.0, own, other })
        })
        .collect()
}

/// The directions of motion v of (2), which diagonalise C, with v^T M v = 1.
struct Directions {
    /// M, a sum over the points.
    metric: Mat6,
    vectors: Vec<Twist>,
}

impl Directions {
    /// Solves (2); `None` if the points do not determine M.
    fn from_matches(matches: &[Match]) -> Option<Directions> {
        let (mut metric, mut cross) = (Mat6::zeros(), Mat6::zeros());
        for m in matches {
            let motion = point_motion(&m.point);
            metric += motion.transpose() * motion * m.weight;
            let product = m.own * m.other.transpose() * (0.5 * m.weight);
            cross += product + product.transpose(); // (2), C
        }
        let inverse = metric.cholesky()?.l().try_inverse()?;
        let eigen = SymmetricEigen::new(inverse * cross * inverse.transpose());
        let vectors = eigen.eigenvectors.column_iter().map(|u| inverse.transpose() * u).collect();
        Some(Directions { metric, vectors })
    }
}

/// Sums over the matches for one direction v.
struct DirectionSums {
    /// v^T C v, which is lambda of (2).
    information: f64,
    /// What the normals' noise alone would give: half of the squared differences of J and K.
    noise: f64,
}

impl DirectionSums {
    fn new(matches: &[Match], v: &Twist) -> DirectionSums {
        let mut sums = DirectionSums { information: 0.0, noise: 0.0 };
        for m in matches {
            let (a, b) = (m.own.dot(v), m.other.dot(v));
            sums.information += m.weight * a * b; // (2)
            sums.noise += m.weight * (a - b) * (a - b) / 2.0;
        }
        sums
    }

    /// Whether the information on the direction exceeds what the normals' noise would give by
    /// chance; `spacing` (metres) is the distance between the matches.
    fn is_observable(&self, matches: &[Match], v: &Twist, spacing: f64) -> bool {
        // If the information is significant even with a single independent measurement, their
        // number does not matter.
        self.information > SIGNIFICANCE_SIGMA * self.noise || {
            let differences = matches.iter().map(|m| m.own.dot(v) - m.other.dot(v)).collect();
            let share = independent_share(matches, differences, spacing);
            let independent = (matches.len() as f64 * share).max(1.0);
            self.information > SIGNIFICANCE_SIGMA * self.noise / independent.sqrt()
        }
    }
}

/// The share of independent values among the `values` of the matches, which lie about `spacing`
/// (metres) apart.
fn independent_share(matches: &[Match], values: Vec<f64>, spacing: f64) -> f64 {
    let positions = matches.iter().map(|m| m.point).collect();
    Correlation::estimate(&[Residuals { positions, values }], spacing).independent_share(spacing)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::register::sharp_shapes_tests::{SENSOR_DISTANCE, shape, simulate_scan};
    use crate::register::strategy::Strategy;
    use crate::scan::{PoseSigma, PreparedScan};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    const SIGMA: PoseSigma = PoseSigma { translation: 3e-3, rotation: 3e-2 };

    /// `object_from_sensor` of a view of the origin along `direction`.
    fn view_along(direction: Vec3) -> Pose {
        let eye = -direction.normalize() * SENSOR_DISTANCE;
        Pose::face_towards(&eye.into(), &nalgebra::Point3::origin(), &Vec3::new(0.3, 1.0, 0.1))
    }

    struct Case {
        scan: RegistrationScan,
        map: Map,
        /// `map_from_scan`.
        truth: Pose,
    }

    /// Two views of a shape from directions that are 15 degrees apart; the first is the map.
    fn two_views(name: &str, direction: Vec3) -> Case {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let strategy = Strategy::new(&RegisterParams::default());
        let poses = [view_along(direction), view_along(direction + Vec3::new(0.2, -0.1, 0.1))];
        let [fixed, scan] = poses.map(|pose| {
            let scan = simulate_scan(&shape(name), &pose, 1e-3, 5e-5, &mut rng);
            RegistrationScan::new(&PreparedScan::new(&scan).unwrap(), SIGMA, &strategy)
        });
        let here = Pose::identity();
        let map = RegistrationScan::map_of(std::iter::once((&fixed, &here)), fixed.map_spacing);
        Case { scan, map, truth: poses[0].inverse() * poses[1] }
    }

    fn evaluated(case: &Case) -> Observability {
        let params = RegisterParams::default();
        Observability::evaluate(&case.scan, &case.map, &case.truth, 4e-3, &params).unwrap()
    }

    /// Root mean square motion of the scan's points along their normals by a unit of `motion`,
    /// relative to that in all directions.
    fn normal_share(scan: &RegistrationScan, motion: &Twist) -> f64 {
        let (mut along, mut all) = (0.0, 0.0);
        for (point, normal) in scan.points.iter().zip(&scan.normals) {
            let moved = point_motion(point) * motion;
            along += normal.dot(&moved).powi(2);
            all += moved.norm_squared();
        }
        (along / all).sqrt()
    }

    /// Matches on a ball of radius 50 mm about a point in front of the sensor, whose normals in
    /// scan and map have independent noise of `tilt` radians.
    fn matches_on_ball(tilt: f64) -> Vec<Match> {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let here = Pose::identity();
        (0..2000)
            .map(|_| {
                let direction =
                    Vec3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal)).normalize();
                let point = ball_center() + direction * 0.05;
                let [own, other] = [(); 2].map(|()| {
                    let noise = Vec3::from_fn(|_, _| tilt * rng.sample::<f64, _>(StandardNormal));
                    point_to_plane(&here, &point, &point, &(direction + noise).normalize()).1
                });
                Match { point, residual: 0.0, weight: 1.0, own, other }
            })
            .collect()
    }

    fn ball_center() -> Vec3 {
        Vec3::new(0.01, -0.02, 0.4)
    }

    #[test]
    fn noise_of_the_normals_adds_no_information_on_the_rotations_of_a_ball() {
        let matches = matches_on_ball(0.05);
        let spacing = 0.1 / (matches.len() as f64).sqrt();
        let about_center =
            crate::geometry::adjoint(&Pose::from(nalgebra::Translation3::from(ball_center())));
        for k in 0..6 {
            let v: Twist = about_center * Twist::from_fn(|i, _| f64::from(i == k));
            let sums = DirectionSums::new(&matches, &v);
            if k < 3 {
                // A third of the squared normals lies along each axis.
                let share = sums.information / matches.len() as f64;
                assert!((share - 1.0 / 3.0).abs() < 0.03, "{k}: {share}");
                assert!(sums.is_observable(&matches, &v, spacing), "{k}");
            } else {
                // Squares of one scan's normals would have the expectation of the noise.
                let squares: f64 = matches.iter().map(|m| m.own.dot(&v).powi(2)).sum();
                assert!((squares / sums.noise - 1.0).abs() < 0.2, "{k}");
                assert!(sums.information.abs() < 0.2 * sums.noise, "{k}: {}", sums.information);
            }
        }
    }

    #[test]
    fn directions_diagonalise_the_information_and_move_the_points_alike() {
        let matches = matches_on_ball(0.02);
        let directions = Directions::from_matches(&matches).unwrap();
        for (i, a) in directions.vectors.iter().enumerate() {
            for (j, b) in directions.vectors.iter().enumerate() {
                let metric = a.dot(&(directions.metric * b));
                assert!((metric - f64::from(i == j)).abs() < 1e-6, "{i} {j}: {metric}");
                let cross: f64 = matches
                    .iter()
                    .map(|m| (m.own.dot(a) * m.other.dot(b) + m.own.dot(b) * m.other.dot(a)) / 2.0)
                    .sum();
                assert!(i == j || cross.abs() < 1e-6, "{i} {j}: {cross}");
            }
        }
        assert!(Directions::from_matches(&[]).is_none());
    }

    #[test]
    fn a_rotation_of_a_ball_is_unobservable_and_goes_back_to_the_prior() {
        let case = two_views("sphere", Vec3::new(1.0, 2.0, 3.0));
        let found = evaluated(&case);
        assert!((1..=3).contains(&found.unobservable.len()), "{:?}", found.unobservable);
        let prior = Prior { pose: case.truth, information: SIGMA.information() };
        for motion in &found.unobservable {
            assert!(normal_share(&case.scan, motion) < 0.1, "{motion}");
            // No information along it: its part is far below that of the observable directions.
            let part = motion.dot(&(found.information * motion));
            assert!(part < 1e-9 * found.information.amax() * motion.norm_squared(), "{part}");
            let moved = case.truth * exp(&(motion * (0.05 / motion.fixed_rows::<3>(3).norm())));
            let [before, after] = [moved, found.remap_to_prior(&moved, &prior)]
                .map(|pose| prior.correction(&pose).norm());
            assert!(before > 0.05 && after < 1e-9, "{before} to {after}");
        }
    }

    #[test]
    fn the_axis_of_a_cylinder_is_unobservable() {
        // Only the mantle is in view.
        let case = two_views("cylinder", Vec3::new(1.0, 0.5, 0.0));
        let found = evaluated(&case);
        assert!(!found.unobservable.is_empty());
        for motion in &found.unobservable {
            assert!(normal_share(&case.scan, motion) < 0.15, "{motion}");
        }
    }

    #[test]
    fn three_faces_of_a_box_determine_everything() {
        let case = two_views("box", Vec3::new(-1.0, -1.2, -0.9));
        let found = evaluated(&case);
        assert!(found.unobservable.is_empty(), "{:?}", found.unobservable);
        let information = found.information.symmetric_eigenvalues();
        assert!(information.min() > 0.0, "{information}");
        let prior = Prior { pose: Pose::identity(), information: SIGMA.information() };
        assert_eq!(found.remap_to_prior(&case.truth, &prior), case.truth);
    }

    #[test]
    fn a_scan_far_from_the_map_has_no_observability() {
        let mut case = two_views("box", Vec3::new(-1.0, -1.2, -0.9));
        case.truth = Pose::translation(1.0, 0.0, 0.0);
        let params = RegisterParams::default();
        assert!(
            Observability::evaluate(&case.scan, &case.map, &case.truth, 4e-3, &params).is_none()
        );
    }
}
