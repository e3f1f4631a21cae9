//! How much the measurements of a range sensor scatter about a surface, estimated from residuals.
//!
//! There are two models. The first is the standard deviation of one measurement by range and
//! incidence: a power law, as the error propagation of triangulating sensors gives it (Nguyen,
//! Izadi, Lovell 2012, 3DIMPVT: quadratic in range, growing with 1 / cos of the incidence). The
//! second says how much of the variance the neighbours in a scan share (components of variance;
//! Searle, Casella, McCulloch 1992, ch. 3, method of moments).

use super::{MAD_TO_SIGMA, median};
use nalgebra::{Matrix3, Vector3};

/// Cosine of the largest angle of incidence, 80 degrees. A ray that grazes a surface at a larger
/// angle meets it at no definite place, and noise does not grow further.
pub(crate) const MIN_INCIDENCE_COS: f64 = 0.17;
/// Smallest range, relative to that of the model, that it is extrapolated to.
const MIN_RANGE_RATIO: f64 = 0.1;
/// Classes of incidence and of range in which residuals are gathered.
const COSINE_CLASSES: usize = 6;
const RANGE_CLASSES: usize = 4;
/// Residuals that a class needs: its robust standard deviation is then known to 20 %.
const MIN_CLASS_RESIDUALS: usize = 40;
/// Weight of the prior that a power is zero, in residuals.
const POWER_PRIOR_WEIGHT: f64 = 50.0;
/// Largest powers of range and of 1 / cos that are believed. A ratio of two models may have
/// negative ones as well.
const MAX_RANGE_POWER: f64 = 3.0;
const MAX_SLANT_POWER: f64 = 2.0;

/// The distance of one measurement from the surface near it.
#[derive(Clone, Copy, Debug)]
pub struct RangeResidual {
    /// Distance from the sensor, metres.
    pub range: f64,
    /// Cosine of the incidence: of the angle between ray and surface normal.
    pub cosine: f64,
    /// Signed distance along the surface normal, metres.
    pub distance: f64,
}

/// Standard deviation along the surface normal of one measurement:
///
/// ```text
/// sigma(r, c) = sigma (r / at_range)^range_power c^-slant_power                                (1)
/// ```
///
/// with the range r and the cosine c of the incidence.
///
/// ```
/// use puffer_core::geometry::NoiseModel;
///
/// // 0.5 m from the sensor, seen head on.
/// assert_eq!(NoiseModel::constant(2e-4).sigma_at(0.5, 1.0), 2e-4);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseModel {
    /// Standard deviation at normal incidence from `at_range`, metres.
    pub sigma: f64,
    /// Reference range, metres.
    pub at_range: f64,
    /// Power of the range.
    pub range_power: f64,
    /// Power of the inverse cosine of the incidence.
    pub slant_power: f64,
}

impl Default for NoiseModel {
    fn default() -> NoiseModel {
        NoiseModel::constant(0.0)
    }
}

impl NoiseModel {
    /// The same standard deviation (metres) everywhere.
    pub fn constant(sigma: f64) -> NoiseModel {
        NoiseModel { sigma, at_range: 1.0, range_power: 0.0, slant_power: 0.0 }
    }

    /// Standard deviation along the normal, metres, at a range (metres) and cosine of the
    /// incidence.
    pub fn sigma_at(&self, range: f64, cosine: f64) -> f64 {
        let slant = cosine.abs().clamp(MIN_INCIDENCE_COS, 1.0);
        let far = (range / self.at_range).max(MIN_RANGE_RATIO);
        self.sigma * far.powf(self.range_power) * slant.powf(-self.slant_power) // (1)
    }

    /// The model of a sensor that took several scans: the medians of the scans' models, each of
    /// which has seen only a part of the ranges and incidences.
    pub fn median_of<'a>(models: impl Iterator<Item = &'a NoiseModel> + Clone) -> NoiseModel {
        let at_range = finite_median(models.clone().map(|m| m.at_range)).max(f64::MIN_POSITIVE);
        NoiseModel {
            sigma: finite_median(models.clone().map(|m| m.sigma_at(at_range, 1.0))),
            at_range,
            range_power: finite_median(models.clone().map(|m| m.range_power)),
            slant_power: finite_median(models.map(|m| m.slant_power)),
        }
    }

    /// The model without negative powers: no sensor is better far away or at grazing incidence.
    pub fn nondecreasing(self) -> NoiseModel {
        NoiseModel {
            range_power: self.range_power.max(0.0),
            slant_power: self.slant_power.max(0.0),
            ..self
        }
    }

    /// Estimates the model from residuals, robustly: a plane through the logarithms of the medians
    /// of classes of range and incidence. `None` if there are too few residuals or most are zero.
    pub fn estimate(residuals: &[RangeResidual]) -> Option<NoiseModel> {
        let at_range = median(residuals.iter().map(|r| r.range).collect())?;
        let (mut matrix, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for class in classify(residuals) {
            let typical = class_medians(&class)?;
            if typical.distance <= 0.0 || typical.range <= 0.0 {
                continue;
            }
            let row = Vector3::new(1.0, (typical.range / at_range).ln(), -typical.cosine.ln());
            let weight = class.len() as f64;
            matrix += row * row.transpose() * weight;
            right += row * (weight * (MAD_TO_SIGMA * typical.distance).ln());
        }
        matrix[(1, 1)] += POWER_PRIOR_WEIGHT;
        matrix[(2, 2)] += POWER_PRIOR_WEIGHT;
        let solved = matrix.cholesky()?.solve(&right);
        let mut model = NoiseModel {
            sigma: 1.0,
            at_range,
            range_power: solved[1].clamp(-MAX_RANGE_POWER, MAX_RANGE_POWER),
            slant_power: solved[2].clamp(-MAX_SLANT_POWER, MAX_SLANT_POWER),
        };
        // The level is estimated again, because priors and limits have changed the powers.
        let relative =
            residuals.iter().map(|r| r.distance.abs() / model.sigma_at(r.range, r.cosine));
        model.sigma = MAD_TO_SIGMA * median(relative.collect())?;
        (model.sigma > 0.0).then_some(model)
    }
}

/// The median of the finite values; 0 if there are none.
fn finite_median(values: impl Iterator<Item = f64>) -> f64 {
    median(values.filter(|v| v.is_finite()).collect()).unwrap_or(0.0)
}

/// Medians of range, cosine and size of the residuals of a class; `None` if it is empty.
fn class_medians(class: &[RangeResidual]) -> Option<RangeResidual> {
    Some(RangeResidual {
        range: median(class.iter().map(|r| r.range).collect())?,
        cosine: median(class.iter().map(|r| r.cosine).collect())?,
        distance: median(class.iter().map(|r| r.distance.abs()).collect())?,
    })
}

/// Residuals by even classes of the cosine and of the range's order statistics; the classes with
/// enough of them.
fn classify(residuals: &[RangeResidual]) -> Vec<Vec<RangeResidual>> {
    let mut ranges: Vec<f64> = residuals.iter().map(|r| r.range).collect();
    ranges.sort_unstable_by(f64::total_cmp);
    let mut classes: Vec<Vec<RangeResidual>> = vec![Vec::new(); COSINE_CLASSES * RANGE_CLASSES];
    for r in residuals.iter().filter(|r| r.cosine >= MIN_INCIDENCE_COS) {
        let slant =
            (r.cosine - MIN_INCIDENCE_COS) / (1.0 - MIN_INCIDENCE_COS) * COSINE_CLASSES as f64;
        let far = ranges.partition_point(|range| *range < r.range) * RANGE_CLASSES / ranges.len();
        let far = far.min(RANGE_CLASSES - 1);
        classes[(slant as usize).min(COSINE_CLASSES - 1) * RANGE_CLASSES + far].push(*r);
    }
    classes.retain(|class| class.len() >= MIN_CLASS_RESIDUALS);
    classes
}

/// The components of the variance of a measurement, in units of the variance stated of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseComponents {
    /// Variance that is drawn anew for each measurement.
    pub white: f64,
    /// Variance of what is the same for all measurements of one scan near to each other: correlated
    /// noise and the error of the pose.
    pub shared: f64,
}

impl NoiseComponents {
    /// All noise is white, and as stated.
    pub const WHITE: NoiseComponents = NoiseComponents { white: 1.0, shared: 0.0 };

    /// Variance of one measurement.
    pub fn total(&self) -> f64 {
        self.white + self.shared
    }
}

/// The (weighted) residuals of one scan about a surface, each divided by its stated standard
/// deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScanResiduals {
    /// Their mean.
    pub mean: f64,
    /// Sum of their squared deviations from the mean.
    pub squared_deviations: f64,
    /// (Effective) number of measurements.
    pub count: f64,
}

/// By how much the residuals exceed what the noise lets expect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Misfit {
    /// The excess in standard deviations of chance.
    pub sigmas: f64,
    /// Ratio of the variance to the expected one.
    pub variance_ratio: f64,
}

/// How much more the means of the scans differ than the noise lets expect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Excess {
    /// Ratio of their variance to the expected one.
    pub variance_ratio: f64,
    /// Number of scans that it rests on.
    pub scans: f64,
}

/// Sums over the residuals of several scans about one surface, each divided by its stated standard
/// deviation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ResidualMoments {
    /// Squared deviations from the means of the scans, and their degrees of freedom.
    within: f64,
    within_freedom: f64,
    /// Squared means of the scans.
    between: f64,
    /// Sum of one over the number of measurements, over the scans.
    inverse_counts: f64,
    /// Number of scans in the last two.
    scans: f64,
}

impl ResidualMoments {
    /// The sums over the residuals of scans about one surface that was fitted to them.
    pub fn from_scans(scans: &[ScanResiduals]) -> ResidualMoments {
        let mut moments = ResidualMoments::default();
        let count = scans.len() as f64;
        for scan in scans {
            moments.within += scan.squared_deviations;
            moments.within_freedom += (scan.count - 1.0).max(0.0);
            if count > 1.0 {
                // The surface was fitted to these scans and took one part in `count` of their
                // errors.
                moments.between += scan.mean * scan.mean * count / (count - 1.0);
                moments.inverse_counts += 1.0 / scan.count;
                moments.scans += 1.0;
            }
        }
        moments
    }

    /// Adds other sums.
    pub fn add(&mut self, other: &ResidualMoments) {
        self.within += other.within;
        self.within_freedom += other.within_freedom;
        self.between += other.between;
        self.inverse_counts += other.inverse_counts;
        self.scans += other.scans;
    }

    /// The components that explain the sums; [`NoiseComponents::WHITE`] if they are empty.
    pub fn components(&self) -> NoiseComponents {
        if self.within_freedom <= 0.0 || self.within <= 0.0 {
            return NoiseComponents::WHITE;
        }
        let white = self.within / self.within_freedom;
        let excess = self.between - white * self.inverse_counts;
        let shared = if self.scans > 0.0 { (excess / self.scans).max(0.0) } else { 0.0 };
        NoiseComponents { white, shared }
    }

    /// How far the spread of the measurements about the means of their scans exceeds what
    /// `components` let expect: well beyond 1 the surface is not as it was fitted.
    pub fn misfit(&self, components: &NoiseComponents) -> Misfit {
        let expected = components.white * self.within_freedom;
        if expected <= 0.0 {
            return Misfit { sigmas: 0.0, variance_ratio: 1.0 };
        }
        let variance_ratio = self.within / expected;
        // A variance from n degrees of freedom has the relative standard deviation sqrt(2 / n).
        let sigmas = (variance_ratio - 1.0) * (self.within_freedom / 2.0).sqrt();
        Misfit { sigmas, variance_ratio }
    }

    /// How much larger the spread of the scans' means is than `components` let expect.
    pub fn excess(&self, components: &NoiseComponents) -> Excess {
        let expected = components.shared * self.scans + components.white * self.inverse_counts;
        if expected > 0.0 {
            Excess { variance_ratio: self.between / expected, scans: self.scans }
        } else {
            Excess { variance_ratio: 1.0, scans: 0.0 }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn normal(rng: &mut ChaCha8Rng) -> f64 {
        StandardNormal.sample(rng)
    }

    #[test]
    fn the_powers_of_range_and_incidence_are_found_among_outliers() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let residuals: Vec<RangeResidual> = (0..20_000)
            .map(|i| {
                let range: f64 = rng.random_range(0.4..1.2);
                let cosine: f64 = rng.random_range(0.25..1.0);
                let sigma = 1e-3 * (range / 0.8).powi(2) * cosine.powf(-0.5);
                let distance = if i % 20 == 0 { 0.05 } else { sigma * normal(&mut rng) };
                RangeResidual { range, cosine, distance }
            })
            .collect();
        let model = NoiseModel::estimate(&residuals).unwrap();
        assert!((model.range_power - 2.0).abs() < 0.2, "{model:?}");
        assert!((model.slant_power - 0.5).abs() < 0.2, "{model:?}");
        let ratio = model.sigma_at(0.8, 1.0) / 1e-3;
        assert!((ratio - 1.0).abs() < 0.15, "{ratio}");
        assert!(NoiseModel::estimate(&residuals[..10]).is_none());
    }

    /// Twenty residuals of standard deviation 1 about `offset`.
    fn residuals_about(offset: f64, rng: &mut ChaCha8Rng) -> ScanResiduals {
        let all: Vec<f64> = (0..20).map(|_| offset + normal(rng)).collect();
        let mean = all.iter().sum::<f64>() / 20.0;
        let squared_deviations = all.iter().map(|e| (e - mean).powi(2)).sum();
        ScanResiduals { mean, squared_deviations, count: 20.0 }
    }

    #[test]
    fn shared_and_white_noise_are_told_apart() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut moments = ResidualMoments::default();
        for _ in 0..500 {
            let offsets: Vec<f64> = (0..8).map(|_| 2.0 * normal(&mut rng)).collect();
            let middle = offsets.iter().sum::<f64>() / 8.0;
            let scans: Vec<ScanResiduals> =
                offsets.iter().map(|offset| residuals_about(offset - middle, &mut rng)).collect();
            moments.add(&ResidualMoments::from_scans(&scans));
        }
        let found = moments.components();
        assert!((found.white - 1.0).abs() < 0.05, "{found:?}");
        assert!((found.shared - 4.0).abs() < 0.4, "{found:?}");
        assert_eq!(ResidualMoments::default().components(), NoiseComponents::WHITE);
    }

    #[test]
    fn misfit_and_excess_are_those_of_hand_computed_sums() {
        let [one, two] = [(1.0, 24.0), (-1.0, 8.0)].map(|(mean, squared_deviations)| {
            ScanResiduals { mean, squared_deviations, count: 9.0 }
        });
        let moments = ResidualMoments::from_scans(&[one, two]);
        // 32 over 16 degrees of freedom: twice the expected 1, off by sqrt(16 / 2) deviations.
        let misfit = moments.misfit(&NoiseComponents::WHITE);
        assert_eq!(misfit, Misfit { sigmas: 8.0_f64.sqrt(), variance_ratio: 2.0 });
        // (1 + 1) 2 / 1 = 4, where two means of nine measurements let expect 2 / 9.
        let excess = moments.excess(&NoiseComponents::WHITE);
        assert!((excess.variance_ratio - 18.0).abs() < 1e-12, "{excess:?}");
        assert_eq!(excess.scans, 2.0);
        // One scan by itself says nothing of what scans differ by.
        let single = ResidualMoments::from_scans(&[one]);
        assert_eq!(single.excess(&NoiseComponents::WHITE).scans, 0.0);
    }

    #[test]
    fn the_model_of_a_sensor_is_the_median_and_never_better_far_away() {
        let models = [1.0, 2.0, 9.0].map(|sigma| NoiseModel {
            sigma,
            at_range: 0.5,
            range_power: -sigma,
            slant_power: 1.0,
        });
        let median = NoiseModel::median_of(models.iter());
        assert_eq!((median.sigma, median.at_range, median.range_power), (2.0, 0.5, -2.0));
        assert_eq!(median.nondecreasing().range_power, 0.0);
        assert_eq!(median.sigma_at(1.0, 1.0), 0.5);
        assert_eq!(median.sigma_at(0.5, 0.5), 4.0);
    }
}
