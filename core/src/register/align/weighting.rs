//! Stage 3: what each correspondence counts for (Rusinkiewicz & Levoy 2001, §3.3), and the robust kernels that make
//! large residuals count for less.

use super::Moving;
use super::matching::Correspondence;
use crate::geometry::{MAD_TO_SIGMA, median};
use crate::register::factors::tukey;

crate::choice! {
    /// What each correspondence counts for before the robust kernel.
    pub enum Weight {
        /// All the same.
        Constant = "constant",
        /// 1 - d / d_max for points d apart (Godin, Rioux & Baribeau 1994).
        Distance = "distance",
        /// The cosine between the normals (Rusinkiewicz & Levoy 2001).
        Normals = "normals",
        /// The inverse variance of a triangulating sensor: its standard deviation grows with the square of the distance
        /// and with 1 / cos of the angle of incidence (Turk & Levoy 1994; Curless & Levoy 1996).
        SensorNoise = "sensor_noise",
        /// One minus the deviation of d from its median, in units of its median absolute deviation scaled to a standard
        /// deviation and counted to three; beyond, nothing.
        Mad = "mad",
    }
}

crate::choice! {
    /// What residuals count for beside smaller ones.
    pub enum Kernel {
        /// Least squares.
        None = "none",
        /// Tukey's biweight: nothing beyond 4.685 standard deviations.
        Tukey = "tukey",
        /// Huber's: least squares to 1.345 standard deviations, least absolute deviations beyond.
        Huber = "huber",
        /// Cauchy's (Lorentzian), 2.385 standard deviations wide.
        Cauchy = "cauchy",
    }
}

impl Kernel {
    /// Weight of a residual `r` in units of its standard deviation (the influence divided by `r`). The widths keep 95 %
    /// of the efficiency of least squares under Gaussian noise (Holland & Welsch 1977, table 1).
    pub(crate) fn weight(self, r: f64) -> f64 {
        let within = |width: f64| (r / width).powi(2);
        match self {
            Kernel::None => 1.0,
            Kernel::Tukey => tukey(r),
            Kernel::Huber => (1.345 / r.abs().max(f64::MIN_POSITIVE)).min(1.0),
            Kernel::Cauchy => 1.0 / (1.0 + within(2.385)),
        }
    }
}

/// Standard deviations at which a weight of [`Weight::Mad`] ends.
const MAD_WIDTH: f64 = 3.0;

impl Weight {
    /// The weights of the correspondences `found` of `moving`; those of [`Weight::SensorNoise`] have mean 1.
    pub(crate) fn of(self, found: &[Correspondence], moving: &Moving) -> Vec<f64> {
        let each = |f: &dyn Fn(&Correspondence) -> f64| found.iter().map(f).collect::<Vec<f64>>();
        match self {
            Weight::Constant => vec![1.0; found.len()],
            Weight::Distance => {
                let largest = found.iter().map(|c| c.gap).fold(f64::MIN_POSITIVE, f64::max);
                each(&|c| 1.0 - c.gap / largest)
            }
            Weight::Normals => each(&|c| c.agreement().max(0.0)),
            Weight::SensorNoise => {
                let weights = each(&|c| {
                    let (ray, normal) = (&moving.rays[c.index], &moving.normals[c.index]);
                    ray.dot(normal).powi(2) / c.point.norm_squared().powi(2).max(f64::MIN_POSITIVE)
                });
                let mean = weights.iter().sum::<f64>() / found.len().max(1) as f64;
                weights.into_iter().map(|w| w / mean.max(f64::MIN_POSITIVE)).collect()
            }
            Weight::Mad => {
                let middle = median(each(&|c| c.distance)).unwrap_or(0.0);
                let deviation = median(each(&|c| (c.distance - middle).abs())).unwrap_or(0.0);
                let width = (MAD_WIDTH * MAD_TO_SIGMA * deviation).max(f64::MIN_POSITIVE);
                each(&|c| (1.0 - (c.distance - middle).abs() / width).max(0.0))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::matching::tests::pair;
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

    /// Weights of ten pairs 0 to 9 mm apart, the last seen at 60 degrees and turned by 60 degrees from the map's normal.
    fn weights(weight: Weight) -> Vec<f64> {
        let mut found: Vec<Correspondence> = (0..10).map(|i| pair(i, i as f64 * 1e-3)).collect();
        let tilted = Vec3::new(0.75_f64.sqrt(), 0.0, 0.5);
        found[9].here = tilted;
        let points = vec![-Vec3::z(); 10];
        let mut normals = vec![Vec3::z(); 10];
        normals[9] = tilted;
        let rays = vec![-Vec3::z(); 10];
        let moving = Moving { points: &points, normals: &normals, rays: &rays, noise: 1e-3 };
        weight.of(&found, &moving)
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
        let moving = Moving { points: &points, normals: &points, rays: &points, noise: 1e-3 };
        let weights = Weight::Mad.of(&found, &moving);
        assert!(weights[4] > 0.9 && weights[5] > 0.9, "{weights:?}");
        assert!(weights[0] < weights[2] && weights[2] < weights[4]);
        assert_eq!(weights[9], 0.0);
    }
}
