//! How much the measurements of a range sensor scatter about a surface, learnt from residuals.
//!
//! Two models: the standard deviation of one measurement by range and incidence, a power law as the error
//! propagation of triangulating sensors gives it (Nguyen, Izadi, Lovell 2012, 3DIMPVT: quadratic in range, growing
//! with 1 / cos of the incidence), and how much of the variance neighbours in a scan share (components of
//! variance; Searle, Casella, McCulloch 1992, ch. 3, method of moments).

use super::{MAD_TO_SIGMA, median};
use nalgebra::{Matrix3, Vector3};

/// Cosines below this count as this: what is seen at a more grazing angle scatters no further.
const LEAST_COSINE: f64 = 0.17;
/// Classes of incidence and of range in which residuals are gathered.
const CLASSES: [usize; 2] = [6, 4];
/// Residuals that a class must have: its robust standard deviation is then known to 20 %.
const LEAST_RESIDUALS: usize = 40;
/// Belief that a power is zero, in residuals.
const BELIEF: f64 = 50.0;
/// Largest powers of range and of 1 / cos believed of a sensor; of the ratio of two, negative ones as well.
const POWERS: [f64; 2] = [3.0, 2.0];

/// The distance of one measurement from the surface near it.
#[derive(Clone, Copy, Debug)]
pub struct Residual {
    /// Distance of the sensor, metres.
    pub range: f64,
    /// Cosine of the incidence: of the angle between ray and surface normal.
    pub cosine: f64,
    /// Along the surface normal, metres, of either sign.
    pub distance: f64,
}

/// Standard deviation along the surface normal of one measurement:
/// `sigma (range / at_range)^range_power cos^-slant_power`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseModel {
    /// Seen head on from `at_range`, metres.
    pub sigma: f64,
    /// Metres.
    pub at_range: f64,
    /// Growth with range.
    pub range_power: f64,
    /// Growth with the incidence.
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

    /// Standard deviation along the normal, metres, at a range (metres) and cosine of incidence.
    pub fn at(&self, range: f64, cosine: f64) -> f64 {
        let slant = cosine.abs().clamp(LEAST_COSINE, 1.0);
        let far = (range / self.at_range).max(0.1);
        self.sigma * far.powf(self.range_power) * slant.powf(-self.slant_power)
    }

    /// The model of a sensor of which several scans were taken: the medians of theirs, each of which has seen too little of
    /// the ranges and incidences.
    pub fn of_scans<'a>(models: impl Iterator<Item = &'a NoiseModel> + Clone) -> NoiseModel {
        let typical = |f: &dyn Fn(&NoiseModel) -> f64| {
            median(models.clone().map(f).filter(|v| v.is_finite()).collect()).unwrap_or(0.0)
        };
        let at_range = typical(&|m| m.at_range).max(f64::MIN_POSITIVE);
        NoiseModel {
            sigma: typical(&|m| m.at(at_range, 1.0)),
            at_range,
            range_power: typical(&|m| m.range_power),
            slant_power: typical(&|m| m.slant_power),
        }
    }

    /// The model of a sensor, none of which is better far away or at grazing incidence.
    pub fn of_sensor(self) -> NoiseModel {
        NoiseModel {
            range_power: self.range_power.max(0.0),
            slant_power: self.slant_power.max(0.0),
            ..self
        }
    }

    /// Learns the model from residuals, robustly: medians of classes of range and incidence, and a line through
    /// their logarithms. `None` if there are too few residuals or most are zero.
    pub fn estimate(residuals: &[Residual]) -> Option<NoiseModel> {
        let at_range = median(residuals.iter().map(|r| r.range).collect())?;
        let (mut matrix, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for class in classes(residuals) {
            let [range, cosine, distance] = class.medians()?;
            if distance <= 0.0 || range <= 0.0 {
                continue;
            }
            let row = Vector3::new(1.0, (range / at_range).ln(), -cosine.ln());
            let weight = class.0.len() as f64;
            matrix += row * row.transpose() * weight;
            right += row * (weight * (MAD_TO_SIGMA * distance).ln());
        }
        matrix[(1, 1)] += BELIEF;
        matrix[(2, 2)] += BELIEF;
        let solved = matrix.cholesky()?.solve(&right);
        let power = |i: usize| solved[i + 1].clamp(-POWERS[i], POWERS[i]);
        let mut model =
            NoiseModel { sigma: 1.0, at_range, range_power: power(0), slant_power: power(1) };
        // The level again, with the powers as they are now.
        let relative = |r: &Residual| r.distance.abs() / model.at(r.range, r.cosine);
        model.sigma = MAD_TO_SIGMA * median(residuals.iter().map(relative).collect())?;
        (model.sigma > 0.0).then_some(model)
    }
}

struct Class(Vec<Residual>);

impl Class {
    /// Medians of range, cosine and size of the residual.
    fn medians(&self) -> Option<[f64; 3]> {
        let of = |f: fn(&Residual) -> f64| median(self.0.iter().map(f).collect());
        Some([of(|r| r.range)?, of(|r| r.cosine)?, of(|r| r.distance.abs())?])
    }
}

/// Residuals by even classes of cosine and of the range's order statistics; those with enough of them.
fn classes(residuals: &[Residual]) -> Vec<Class> {
    let mut ranges: Vec<f64> = residuals.iter().map(|r| r.range).collect();
    ranges.sort_unstable_by(f64::total_cmp);
    let mut found: Vec<Class> = (0..CLASSES[0] * CLASSES[1]).map(|_| Class(Vec::new())).collect();
    for r in residuals.iter().filter(|r| r.cosine >= LEAST_COSINE) {
        let slant = (r.cosine - LEAST_COSINE) / (1.0 - LEAST_COSINE) * CLASSES[0] as f64;
        let far = ranges.partition_point(|range| *range < r.range) * CLASSES[1] / ranges.len();
        let far = far.min(CLASSES[1] - 1);
        found[(slant as usize).min(CLASSES[0] - 1) * CLASSES[1] + far].0.push(*r);
    }
    found.retain(|class| class.0.len() >= LEAST_RESIDUALS);
    found
}

/// What the variance of a measurement is made of, in units of the variance stated of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Components {
    /// Drawn anew for each measurement.
    pub white: f64,
    /// The same for all measurements of one scan near to each other: correlated noise, error of the pose.
    pub shared: f64,
}

impl Components {
    /// All noise is white, and as stated.
    pub const WHITE: Components = Components { white: 1.0, shared: 0.0 };

    /// Variance of one measurement.
    pub fn total(&self) -> f64 {
        self.white + self.shared
    }
}

/// Sums over the residuals of several scans about one surface, each divided by its stated standard deviation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    within: f64,
    within_freedom: f64,
    between: f64,
    inverse_counts: f64,
    scans: f64,
}

impl Moments {
    /// Of scans, each with the (weighted) mean of its residuals, the sum of the squared deviations from it and
    /// the (effective) number of measurements.
    pub fn of_scans(scans: &[(f64, f64, f64)]) -> Moments {
        let mut moments = Moments::default();
        let count = scans.len() as f64;
        for &(mean, deviations, number) in scans {
            moments.within += deviations;
            moments.within_freedom += (number - 1.0).max(0.0);
            if count > 1.0 {
                // The surface was fitted to these scans and took one part in `count` of their errors.
                moments.between += mean * mean * count / (count - 1.0);
                moments.inverse_counts += 1.0 / number;
                moments.scans += 1.0;
            }
        }
        moments
    }

    /// Adds other sums.
    pub fn add(&mut self, other: &Moments) {
        self.within += other.within;
        self.within_freedom += other.within_freedom;
        self.between += other.between;
        self.inverse_counts += other.inverse_counts;
        self.scans += other.scans;
    }

    /// The components that explain the sums; [`Components::WHITE`] if there is nothing to learn from.
    pub fn components(&self) -> Components {
        if self.within_freedom <= 0.0 || self.within <= 0.0 {
            return Components::WHITE;
        }
        let white = self.within / self.within_freedom;
        let excess = self.between - white * self.inverse_counts;
        let shared = if self.scans > 0.0 { (excess / self.scans).max(0.0) } else { 0.0 };
        Components { white, shared }
    }

    /// By how many standard deviations the spread of the measurements about the means of their scans exceeds what
    /// `components` say, and the ratio of the variances: well beyond 1 the surface is not as it was fitted.
    pub fn misfit(&self, components: &Components) -> (f64, f64) {
        let expected = components.white * self.within_freedom;
        if expected <= 0.0 {
            return (0.0, 1.0);
        }
        let ratio = self.within / expected;
        // A variance from n degrees of freedom has the relative standard deviation sqrt(2 / n).
        ((ratio - 1.0) * (self.within_freedom / 2.0).sqrt(), ratio)
    }

    /// How much larger the spread of the scans' means is than `components` say, as a ratio of variances, and the
    /// number of scans it rests on.
    pub fn excess(&self, components: &Components) -> (f64, f64) {
        let expected = components.shared * self.scans + components.white * self.inverse_counts;
        if expected > 0.0 { (self.between / expected, self.scans) } else { (1.0, 0.0) }
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
        let residuals: Vec<Residual> = (0..20_000)
            .map(|i| {
                let range: f64 = rng.random_range(0.4..1.2);
                let cosine: f64 = rng.random_range(0.25..1.0);
                let sigma = 1e-3 * (range / 0.8).powi(2) * cosine.powf(-0.5);
                let distance = if i % 20 == 0 { 0.05 } else { sigma * normal(&mut rng) };
                Residual { range, cosine, distance }
            })
            .collect();
        let model = NoiseModel::estimate(&residuals).unwrap();
        assert!((model.range_power - 2.0).abs() < 0.2, "{model:?}");
        assert!((model.slant_power - 0.5).abs() < 0.2, "{model:?}");
        let ratio = model.at(0.8, 1.0) / 1e-3;
        assert!((ratio - 1.0).abs() < 0.15, "{ratio}");
        assert!(NoiseModel::estimate(&residuals[..10]).is_none());
    }

    #[test]
    fn shared_and_white_noise_are_told_apart() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut moments = Moments::default();
        for _ in 0..500 {
            let offsets: Vec<f64> = (0..8).map(|_| 2.0 * normal(&mut rng)).collect();
            let middle = offsets.iter().sum::<f64>() / 8.0;
            let scan = |offset: &f64| {
                let all: Vec<f64> = (0..20).map(|_| offset - middle + normal(&mut rng)).collect();
                let mean = all.iter().sum::<f64>() / 20.0;
                (mean, all.iter().map(|e| (e - mean).powi(2)).sum(), 20.0)
            };
            moments.add(&Moments::of_scans(&offsets.iter().map(scan).collect::<Vec<_>>()));
        }
        let found = moments.components();
        assert!((found.white - 1.0).abs() < 0.05, "{found:?}");
        assert!((found.shared - 4.0).abs() < 0.4, "{found:?}");
        assert_eq!(Moments::default().components(), Components::WHITE);
    }
}
