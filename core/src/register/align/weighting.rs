//! Stage 3: what each correspondence counts for (Rusinkiewicz & Levoy 2001, §3.3), and the robust
//! kernels that make large residuals count for less.

use super::factors::tukey;
use super::matching::Correspondence;
use super::source::Source;
use crate::geometry::{MAD_TO_SIGMA, median};
use crate::register::params::{Kernel, Weight};

/// Residuals, in standard deviations, up to which Huber's kernel is least squares.
const HUBER_WIDTH: f64 = 1.345;
/// Width of Cauchy's kernel, in standard deviations of a residual.
const CAUCHY_WIDTH: f64 = 2.385;
/// Standard deviations at which a weight of [`Weight::Mad`] ends.
const MAD_MAX_SIGMAS: f64 = 3.0;

impl Kernel {
    /// Weight of a residual `r` in units of its standard deviation (the influence divided by `r`).
    /// The widths keep 95 % of the efficiency of least squares under Gaussian noise (Holland &
    /// Welsch 1977, table 1).
    pub(crate) fn weight(self, r: f64) -> f64 {
        match self {
            Kernel::None => 1.0,
            Kernel::Tukey => tukey(r),
            Kernel::Huber => (HUBER_WIDTH / r.abs().max(f64::MIN_POSITIVE)).min(1.0),
            Kernel::Cauchy => 1.0 / (1.0 + (r / CAUCHY_WIDTH).powi(2)),
        }
    }
}

impl Weight {
    /// The weights of `pairs` of the points `source`; those of [`Weight::SensorNoise`] have mean 1.
    pub(crate) fn weigh(self, pairs: &[Correspondence], source: &Source) -> Vec<f64> {
        match self {
            Weight::Constant => vec![1.0; pairs.len()],
            Weight::Distance => {
                let largest =
                    pairs.iter().map(|c| c.point_distance).fold(f64::MIN_POSITIVE, f64::max);
                pairs.iter().map(|c| 1.0 - c.point_distance / largest).collect()
            }
            Weight::Normals => pairs.iter().map(|c| c.normal_cos().max(0.0)).collect(),
            Weight::SensorNoise => {
                let weights: Vec<f64> = pairs.iter().map(|c| inverse_variance(c, source)).collect();
                let mean = weights.iter().sum::<f64>() / pairs.len().max(1) as f64;
                weights.into_iter().map(|w| w / mean.max(f64::MIN_POSITIVE)).collect()
            }
            Weight::Mad => {
                let middle =
                    median(pairs.iter().map(|c| c.plane_distance).collect()).unwrap_or(0.0);
                let deviations = pairs.iter().map(|c| (c.plane_distance - middle).abs());
                let deviation = median(deviations.clone().collect()).unwrap_or(0.0);
                let width = (MAD_MAX_SIGMAS * MAD_TO_SIGMA * deviation).max(f64::MIN_POSITIVE);
                deviations.map(|d| (1.0 - d / width).max(0.0)).collect()
            }
        }
    }
}

/// The inverse variance of a point of a triangulating sensor, up to a factor.
fn inverse_variance(pair: &Correspondence, source: &Source) -> f64 {
    let (ray, normal) = (&source.rays[pair.index], &source.normals[pair.index]);
    ray.dot(normal).powi(2) / pair.point.norm_squared().powi(2).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::super::matching_tests::pair;
    use super::*;
    use crate::geometry::Vec3;

    #[test]
    fn kernels_are_one_at_zero_fall_and_only_tukey_ends() {
        for kernel in [Kernel::Tukey, Kernel::Huber, Kernel::Cauchy] {
            assert_eq!(kernel.weight(0.0), 1.0);
            let at: Vec<f64> = (0..60).map(|i| kernel.weight(0.1 * f64::from(i))).collect();
            assert!(at.windows(2).all(|w| w[1] <= w[0]), "{kernel:?}");
            assert_eq!(kernel.weight(-2.0), kernel.weight(2.0));
            assert_eq!(kernel.weight(5.0) == 0.0, kernel == Kernel::Tukey);
        }
        assert!(Kernel::Tukey.weight(1.0) > 0.9);
        assert_eq!(Kernel::Huber.weight(2.69), 0.5);
        assert_eq!(Kernel::Cauchy.weight(2.385), 0.5);
        assert_eq!(Kernel::None.weight(100.0), 1.0);
    }

    /// Weights of ten pairs 0 to 9 mm apart, the last seen at 60 degrees and turned by 60 degrees
    /// from the map's normal.
    fn weights(weight: Weight) -> Vec<f64> {
        let mut found: Vec<Correspondence> = (0..10).map(|i| pair(i, i as f64 * 1e-3)).collect();
        let tilted = Vec3::new(0.75_f64.sqrt(), 0.0, 0.5);
        found[9].source_normal = tilted;
        let points = vec![-Vec3::z(); 10];
        let mut normals = vec![Vec3::z(); 10];
        normals[9] = tilted;
        let rays = vec![-Vec3::z(); 10];
        let source = Source { points: &points, normals: &normals, rays: &rays, noise: 1e-3 };
        weight.weigh(&found, &source)
    }

    #[test]
    fn each_weight_says_what_it_stands_for() {
        assert_eq!(weights(Weight::Constant), [1.0; 10]);
        let distance = weights(Weight::Distance);
        assert!((distance[0] - 1.0).abs() < 1e-12 && distance[9].abs() < 1e-12);
        assert!((distance[3] - 2.0 / 3.0).abs() < 1e-12);
        assert!((weights(Weight::Normals)[9] - 0.5).abs() < 1e-12);
        let noise = weights(Weight::SensorNoise);
        assert!((noise[9] / noise[0] - 0.25).abs() < 1e-12);
        assert!((noise.iter().sum::<f64>() - 10.0).abs() < 1e-9);
    }

    #[test]
    fn the_weight_by_mad_is_highest_at_the_median_and_ends_beyond() {
        let mut found: Vec<Correspondence> = (0..9).map(|i| pair(i, i as f64 * 1e-3)).collect();
        found.push(pair(9, 0.5));
        let points = [Vec3::z(); 10];
        let source = Source { points: &points, normals: &points, rays: &points, noise: 1e-3 };
        let weights = Weight::Mad.weigh(&found, &source);
        assert!(weights[4] > 0.9 && weights[5] > 0.9, "{weights:?}");
        assert!(weights[0] < weights[2] && weights[2] < weights[4]);
        assert_eq!(weights[9], 0.0);
    }
}
