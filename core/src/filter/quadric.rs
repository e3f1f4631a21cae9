//! A height field fitted robustly over a tangent plane (Levin 2003, Mesh-independent surface interpolation;
//! weights as in iteratively reweighted least squares).

use super::mixed::{Equations, Local, Terms};
use crate::geometry::{Components, MAD_TO_SIGMA, Moments, Vec3, any_orthogonal};
use nalgebra::SVector;

/// One measurement seen by the fit.
#[derive(Clone, Copy)]
pub(super) struct Measured {
    pub point: Vec3,
    pub scan: u16,
    /// Standard deviation along the normal that its scan states, metres.
    pub sigma: f64,
}

/// The height field `h = c0 + c1 u + c2 v + c3 u^2 + c4 u v + c5 v^2` at its foot point.
pub(super) struct Fit {
    /// Point of the surface above the seed, metres.
    pub point: Vec3,
    /// Unit normal there, on the side of the start normal.
    pub normal: Vec3,
    /// Standard deviation of the point along the normal, metres.
    pub sigma: f64,
    /// Sum of the robust weights: measurements that agree with the surface.
    pub effective: f64,
    /// Scans among them.
    pub support: u16,
    /// Residuals of the scans, in stated standard deviations.
    pub moments: Moments,
}

/// Reweighting passes at most.
const PASSES: usize = 4;
/// Weights that change by less in the mean are as they will be.
const SETTLED: f64 = 0.01;
/// Tukey's constant: 95 % efficient for normal noise.
const TUKEY: f64 = 4.685;
/// Variance of normal numbers under those weights: `E[w x^2] / E[w]`.
const TUKEY_VARIANCE: f64 = 0.829;

/// Fits the surface near `seed` with start normal `normal` from measurements within `radius`, whose noise is made of
/// `noise`. `None` if too few agree.
pub(super) fn fit(
    measured: &[Measured],
    seed: &Vec3,
    normal: &Vec3,
    radius: f64,
    noise: &Components,
) -> Option<Fit> {
    let (u, v) = (any_orthogonal(normal), normal.cross(&any_orthogonal(normal)));
    let mut scans: Vec<u16> = measured.iter().map(|m| m.scan).collect();
    scans.sort_unstable();
    scans.dedup();
    // Scaled to the radius, so that the normal equations stay well conditioned.
    let mut local: Vec<Local> = measured
        .iter()
        .map(|m| {
            let offset = (m.point - seed) / radius;
            let (a, b) = (offset.dot(&u), offset.dot(&v));
            let near = (1.0 - (a * a + b * b)).max(0.0);
            let sharp = radius / m.sigma;
            Local {
                terms: SVector::from([1.0, a, b, a * a, a * b, b * b]) * sharp,
                height: offset.dot(normal) * sharp,
                scan: scans.partition_point(|s| *s < m.scan),
                near,
                robust: 1.0,
            }
        })
        .collect();
    let mut solved = None;
    for pass in 0..PASSES {
        let equations = Equations::new(&local, scans.len(), noise);
        let factor = equations.factor()?;
        let coefficients = factor.solve(&equations.right);
        let moved = reweight(&mut local, &coefficients, noise, pass == 0);
        solved = Some((coefficients, equations, factor));
        if moved < SETTLED {
            break;
        }
    }
    let (coefficients, equations, factor) = solved?;
    let slope = u * coefficients[1] + v * coefficients[2];
    let spread = Spread::new(&local, scans.len(), &coefficients);
    Some(Fit {
        point: seed + normal * (coefficients[0] * radius),
        normal: (normal - slope).normalize(),
        sigma: equations.variance(&factor, &local).sqrt() * radius,
        effective: local.iter().map(|l| l.robust).sum(),
        support: spread.support,
        moments: spread.moments,
    })
}

/// Tukey's weights by residuals in standard deviations. Gives by how much they changed in the mean.
fn reweight(local: &mut [Local], coefficients: &Terms, noise: &Components, lenient: bool) -> f64 {
    let sizes: Vec<f64> = local.iter().map(|l| l.residual(coefficients).abs()).collect();
    let mut ordered = sizes.clone();
    let middle = sizes.len() / 2;
    let median = *ordered.select_nth_unstable_by(middle, f64::total_cmp).1;
    let scale = (MAD_TO_SIGMA * median).max(noise.total().sqrt());
    // The first pass may lean on an outlier or another sheet: be lenient, then strict.
    let reach = if lenient { 3.0 } else { 1.0 } * TUKEY * scale;
    let mut moved = 0.0;
    for (l, size) in local.iter_mut().zip(sizes) {
        let r = size / reach;
        let robust = if r < 1.0 { (1.0 - r * r).powi(2) } else { 0.0 };
        moved += (robust - l.robust).abs();
        l.robust = robust;
    }
    if lenient { f64::INFINITY } else { moved / local.len() as f64 }
}

/// How the residuals of the scans spread.
struct Spread {
    moments: Moments,
    /// Scans with a measurement that agrees.
    support: u16,
}

impl Spread {
    fn new(local: &[Local], scans: usize, coefficients: &Terms) -> Spread {
        let mut sums = vec![[0.0; 4]; scans];
        for l in local {
            let w = l.weight();
            let e = l.residual(coefficients) / TUKEY_VARIANCE.sqrt();
            for (sum, value) in sums[l.scan].iter_mut().zip([w, w * w, w * e, w * e * e]) {
                *sum += value;
            }
        }
        sums.retain(|s| s[0] > 0.0);
        let scan = |[w, ww, we, wee]: &[f64; 4]| {
            let (mean, count) = (we / w, w * w / ww);
            (mean, (wee / w - mean * mean).max(0.0) * count, count)
        };
        let found: Vec<(f64, f64, f64)> = sums.iter().map(scan).collect();
        Spread { moments: Moments::of_scans(&found), support: found.len() as u16 }
    }
}
