//! A height field fitted robustly over a tangent plane (Levin 2003, Mesh-independent surface
//! interpolation), by iteratively reweighted least squares with Tukey's biweight.

use super::mixed_model::{LocalMeasurement, MixedModelEquations, Terms, quadric_terms};
use crate::geometry::{
    MAD_TO_SIGMA, NoiseComponents, ResidualMoments, ScanResiduals, TUKEY_CUTOFF_SIGMA, Vec3,
    any_orthogonal,
};

/// One measurement that takes part in a fit.
#[derive(Clone, Copy)]
pub(super) struct Measured {
    /// Position, metres.
    pub point: Vec3,
    /// Index of its scan.
    pub scan: u16,
    /// Standard deviation along the normal that its scan states, metres.
    pub sigma: f64,
}

/// The height field `h = c0 + c1 u + c2 v + c3 u^2 + c4 u v + c5 v^2` at its foot point.
pub(crate) struct Fit {
    /// Point of the surface above the seed, metres.
    pub point: Vec3,
    /// Unit normal there, on the side of the start normal.
    pub normal: Vec3,
    /// Standard deviation of the point along the normal, metres.
    pub sigma: f64,
    /// Sum of the robust weights: the effective number of measurements that agree with the surface.
    pub effective: f64,
    /// Number of scans among them.
    pub support: u16,
    /// Residuals of the scans, in stated standard deviations.
    pub moments: ResidualMoments,
}

/// Reweighting passes at most.
const MAX_PASSES: usize = 4;
/// Mean change of the weights below which they have converged.
const MAX_SETTLED_CHANGE: f64 = 0.01;
/// Factor on the reach of the biweight in the first pass, whose surface may lean on an outlier or
/// on another sheet.
const FIRST_PASS_REACH_RATIO: f64 = 3.0;
/// Variance of standard normal numbers under Tukey's weights: `E[w x^2] / E[w]`.
const TUKEY_VARIANCE: f64 = 0.829;

/// Fits the surface near `seed` with start normal `normal` from measurements within `radius`
/// (metres), whose noise consists of `noise`. `None` if too few agree.
pub(super) fn fit_quadric(
    measured: &[Measured],
    seed: &Vec3,
    normal: &Vec3,
    radius: f64,
    noise: &NoiseComponents,
) -> Option<Fit> {
    let (u, v) = (any_orthogonal(normal), normal.cross(&any_orthogonal(normal)));
    let mut scans: Vec<u16> = measured.iter().map(|m| m.scan).collect();
    scans.sort_unstable();
    scans.dedup();
    // Lengths are scaled to the radius, so that the normal equations stay well conditioned.
    let mut local: Vec<LocalMeasurement> = measured
        .iter()
        .map(|m| {
            let offset = (m.point - seed) / radius;
            let (a, b) = (offset.dot(&u), offset.dot(&v));
            let inverse_sigma = radius / m.sigma;
            LocalMeasurement {
                terms: quadric_terms(a, b) * inverse_sigma,
                height: offset.dot(normal) * inverse_sigma,
                scan: scans.partition_point(|s| *s < m.scan),
                distance_weight: (1.0 - (a * a + b * b)).max(0.0),
                robust_weight: 1.0,
            }
        })
        .collect();
    let mut solved = None;
    for pass in 0..MAX_PASSES {
        let equations = MixedModelEquations::new(&local, scans.len(), noise);
        let factor = equations.factor()?;
        let coefficients = factor.solve(&equations.right);
        let change = reweight(&mut local, &coefficients, noise, pass == 0);
        solved = Some((coefficients, equations, factor));
        if change < MAX_SETTLED_CHANGE {
            break;
        }
    }
    let (coefficients, equations, factor) = solved?;
    let slope = u * coefficients[1] + v * coefficients[2];
    let residuals = scan_residuals(&local, scans.len(), &coefficients);
    Some(Fit {
        point: seed + normal * (coefficients[0] * radius),
        normal: (normal - slope).normalize(),
        sigma: equations.height_variance(&factor, &local).sqrt() * radius,
        effective: local.iter().map(|l| l.robust_weight).sum(),
        support: residuals.len() as u16,
        moments: ResidualMoments::from_scans(&residuals),
    })
}

/// Sets Tukey's weights by the residuals in standard deviations. Returns the mean change of the
/// weights; infinity in the first pass, after which another one is always needed.
fn reweight(
    local: &mut [LocalMeasurement],
    coefficients: &Terms,
    noise: &NoiseComponents,
    is_first: bool,
) -> f64 {
    let sizes: Vec<f64> = local.iter().map(|l| l.residual(coefficients).abs()).collect();
    let mut ordered = sizes.clone();
    let middle = sizes.len() / 2;
    let median_size = *ordered.select_nth_unstable_by(middle, f64::total_cmp).1;
    let scale = (MAD_TO_SIGMA * median_size).max(noise.total().sqrt());
    let reach = if is_first { FIRST_PASS_REACH_RATIO } else { 1.0 } * TUKEY_CUTOFF_SIGMA * scale;
    let mut change = 0.0;
    for (l, size) in local.iter_mut().zip(sizes) {
        let r = size / reach;
        let weight = if r < 1.0 { (1.0 - r * r).powi(2) } else { 0.0 };
        change += (weight - l.robust_weight).abs();
        l.robust_weight = weight;
    }
    if is_first { f64::INFINITY } else { change / local.len() as f64 }
}

/// Weighted sums over the residuals of one scan.
#[derive(Clone, Copy, Default)]
struct WeightedSums {
    weight: f64,
    squared_weight: f64,
    residual: f64,
    squared_residual: f64,
}

impl WeightedSums {
    fn add(&mut self, weight: f64, residual: f64) {
        self.weight += weight;
        self.squared_weight += weight * weight;
        self.residual += weight * residual;
        self.squared_residual += weight * residual * residual;
    }

    fn summarise(&self) -> ScanResiduals {
        let mean = self.residual / self.weight;
        let count = self.weight * self.weight / self.squared_weight;
        let variance = (self.squared_residual / self.weight - mean * mean).max(0.0);
        ScanResiduals { mean, squared_deviations: variance * count, count }
    }
}

/// The residuals of each of the scans that agree with the surface, in stated standard deviations.
fn scan_residuals(
    local: &[LocalMeasurement],
    scans: usize,
    coefficients: &Terms,
) -> Vec<ScanResiduals> {
    let mut sums = vec![WeightedSums::default(); scans];
    for l in local {
        // Outer residuals have little weight; without this factor the spread would seem too small.
        sums[l.scan].add(l.weight(), l.residual(coefficients) / TUKEY_VARIANCE.sqrt());
    }
    sums.iter().filter(|s| s.weight > 0.0).map(WeightedSums::summarise).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS: f64 = 0.004;

    /// Measurements of `height(x, y)` over a disc of [`RADIUS`], by turns of two scans.
    fn measure(height: impl Fn(f64, f64) -> f64) -> Vec<Measured> {
        (0..400)
            .map(|i| {
                // Fermat's spiral covers the disc evenly.
                let (angle, r) = (f64::from(i) * 2.4, RADIUS * (f64::from(i) / 400.0).sqrt());
                let (x, y) = (r * angle.cos(), r * angle.sin());
                Measured { point: Vec3::new(x, y, height(x, y)), scan: (i % 2) as u16, sigma: 1e-5 }
            })
            .collect()
    }

    fn fit_at_origin(measured: &[Measured]) -> Fit {
        fit_quadric(measured, &Vec3::zeros(), &Vec3::z(), RADIUS, &NoiseComponents::WHITE).unwrap()
    }

    fn tilted_quadric(x: f64, y: f64) -> f64 {
        1e-4 + 0.05 * x - 0.03 * y + 2.0 * x * x - 1.5 * x * y
    }

    #[test]
    fn a_tilted_quadric_is_found_with_the_gradient_of_its_height() {
        // Weak priors flatten the fit by a few parts in a thousand of these slopes.
        let fit = fit_at_origin(&measure(tilted_quadric));
        let step = 1e-6;
        let slopes = [
            (tilted_quadric(step, 0.0) - tilted_quadric(-step, 0.0)) / (2.0 * step),
            (tilted_quadric(0.0, step) - tilted_quadric(0.0, -step)) / (2.0 * step),
        ];
        let expected = Vec3::new(-slopes[0], -slopes[1], 1.0).normalize();
        assert!((fit.point.z - 1e-4).abs() < 5e-6, "{}", fit.point);
        assert!(fit.normal.angle(&expected) < 2e-3, "{} {expected}", fit.normal);
        assert_eq!(fit.support, 2);
    }

    #[test]
    fn outliers_move_the_fit_less_than_a_thousandth_of_their_height() {
        let mut measured = measure(|_, _| 0.0);
        for m in measured.iter_mut().step_by(10) {
            m.point.z += 2e-3;
        }
        let fit = fit_at_origin(&measured);
        assert!(fit.point.z.abs() < 2e-6, "{}", fit.point.z);
        assert!((fit.effective - 360.0).abs() < 2.0, "{}", fit.effective);
    }

    #[test]
    fn the_variance_of_equal_weights_is_that_of_their_residuals() {
        let mut sums = WeightedSums::default();
        for residual in [1.0, 2.0, 6.0] {
            sums.add(0.5, residual);
        }
        let found = sums.summarise();
        assert!((found.mean - 3.0).abs() < 1e-12 && (found.count - 3.0).abs() < 1e-12);
        // (2^2 + 1^2 + 3^2) = 14.
        assert!((found.squared_deviations - 14.0).abs() < 1e-9, "{}", found.squared_deviations);
    }
}
