//! A height field fitted robustly over a tangent plane (Levin 2003, Mesh-independent surface interpolation;
//! weights as in iteratively reweighted least squares).

use crate::geometry::{Vec3, any_orthogonal};
use nalgebra::{SMatrix, SVector};

/// One measurement seen by the fit.
#[derive(Clone, Copy)]
pub(super) struct Measured {
    pub point: Vec3,
    pub scan: u16,
    /// Weight by noise and incidence, before distance and robustness.
    pub weight: f64,
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
}

const TERMS: usize = 6;
/// Reweighting passes; the weights change by less than a per cent after four.
const PASSES: usize = 4;

/// Fits the surface near `seed` with start normal `normal` from measurements within `radius`; `floor` is the
/// smallest standard deviation believed of a measurement (metres). `None` if too few agree.
pub(super) fn fit(
    measured: &[Measured],
    seed: &Vec3,
    normal: &Vec3,
    radius: f64,
    floor: f64,
) -> Option<Fit> {
    let (u, v) = (any_orthogonal(normal), normal.cross(&any_orthogonal(normal)));
    // Scaled to the radius, so that the normal equations stay well conditioned.
    let local: Vec<(SVector<f64, TERMS>, f64, f64)> = measured
        .iter()
        .map(|m| {
            let offset = (m.point - seed) / radius;
            let (a, b) = (offset.dot(&u), offset.dot(&v));
            let near = (1.0 - (a * a + b * b)).max(0.0);
            (
                SVector::from([1.0, a, b, a * a, a * b, b * b]),
                offset.dot(normal),
                m.weight * near * near,
            )
        })
        .collect();
    let mut robust: Vec<f64> = vec![1.0; local.len()];
    let mut coefficients = SVector::<f64, TERMS>::zeros();
    let mut scale = f64::INFINITY;
    for pass in 0..PASSES {
        coefficients = solve(&local, &robust)?;
        let mut absolute: Vec<f64> =
            local.iter().map(|(x, h, _)| (h - x.dot(&coefficients)).abs()).collect();
        let residuals = absolute.clone();
        let middle = absolute.len() / 2;
        let median = *absolute.select_nth_unstable_by(middle, f64::total_cmp).1;
        scale = (1.4826 * median).max(floor / radius);
        // The first pass may lean on an outlier or another sheet: be lenient, then strict.
        let reach = if pass == 0 { 3.0 } else { 1.0 } * 4.685 * scale;
        for (weight, r) in robust.iter_mut().zip(residuals) {
            *weight = if r < reach { (1.0 - (r / reach).powi(2)).powi(2) } else { 0.0 };
        }
    }
    let slope = u * coefficients[1] + v * coefficients[2];
    let effective = robust.iter().sum();
    let (sigma, support) = uncertainty(measured, &local, &robust, &coefficients, scale);
    Some(Fit {
        point: seed + normal * (coefficients[0] * radius),
        normal: (normal - slope).normalize(),
        sigma: sigma * radius,
        effective,
        support,
    })
}

fn solve(local: &[(SVector<f64, TERMS>, f64, f64)], robust: &[f64]) -> Option<SVector<f64, TERMS>> {
    let mut matrix = SMatrix::<f64, TERMS, TERMS>::zeros();
    let mut right = SVector::<f64, TERMS>::zeros();
    let mut total = 0.0;
    for ((x, h, weight), robust) in local.iter().zip(robust) {
        let w = weight * robust;
        matrix += x * x.transpose() * w;
        right += x * (h * w);
        total += w;
    }
    if total <= 0.0 {
        return None;
    }
    // A weak belief in flatness (and, weaker, in zero slope) decides where measurements cannot. It is strong
    // at the border of the measured area, where a curvature would be an extrapolation.
    let aside = (matrix[(0, 1)].powi(2) + matrix[(0, 2)].powi(2)) / (total * total);
    let (slope, curvature) = (1e-3 + 0.1 * aside, 1e-2 + 4.0 * aside);
    for (i, belief) in [1e-9, slope, slope, curvature, curvature, curvature].into_iter().enumerate()
    {
        matrix[(i, i)] += belief * total;
    }
    matrix.cholesky().map(|c| c.solve(&right))
}

/// Standard deviation of the height at the seed (in units of the radius) and number of scans. Scans err as a
/// whole (pose, correlated noise), so the spread of their mean residuals counts, not that of the points.
fn uncertainty(
    measured: &[Measured],
    local: &[(SVector<f64, TERMS>, f64, f64)],
    robust: &[f64],
    coefficients: &SVector<f64, TERMS>,
    scale: f64,
) -> (f64, u16) {
    let mut scans: Vec<(u16, f64, f64)> = Vec::new();
    let (mut total, mut squares) = (0.0, 0.0);
    for ((m, (x, h, weight)), robust) in measured.iter().zip(local).zip(robust) {
        let w = weight * robust;
        if w <= 0.0 {
            continue;
        }
        total += w;
        squares += w * w;
        let r = h - x.dot(coefficients);
        match scans.iter_mut().find(|s| s.0 == m.scan) {
            Some(sum) => {
                sum.1 += w * r;
                sum.2 += w;
            }
            None => scans.push((m.scan, w * r, w)),
        }
    }
    let white = scale * squares.sqrt() / total.max(f64::MIN_POSITIVE);
    let count = scans.len() as f64;
    let between: f64 = scans.iter().map(|(_, sum, _)| (sum / total).powi(2)).sum();
    let common = if scans.len() > 1 { (between * count / (count - 1.0)).sqrt() } else { scale };
    (white.max(common), scans.len() as u16)
}
