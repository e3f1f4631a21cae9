//! Votes of single points on what lies inside: where two sheets face each other so closely that
//! they nearly cancel in the winding number, the nearer one decides.

use crate::geometry::{Cloud, Vec3};
use crate::mesh::isosurface::Lattice;
use libm::erf;
use rayon::prelude::*;
use std::f64::consts::{PI, SQRT_2};
use std::ops::Range;

/// Half thickness of the layer about the sheet in which a point votes, in spacings of the points.
const VOTE_REACH_SPACINGS: f64 = 1.5;
/// Standard deviation of a point's vote along the sheet, in spacings: neighbours overlap to an even
/// sum.
const LATERAL_SIGMA_SPACINGS: f64 = 0.6;
/// Distance along the sheet, in lateral standard deviations, beyond which a vote counts as nothing.
const MAX_LATERAL_SIGMAS: f64 = 3.0;
/// Least standard deviation across the sheet, in lattice spacings: a step between two corners would
/// put the surface anywhere between them.
const MIN_SIGMA_LATTICE_SPACINGS: f64 = 0.3;

/// Adds to the values of `lattice` the votes of sheets that face each other, scaled so that a whole
/// sheet votes -1 just inside and 1 just outside:
///
/// ```text
/// V(x) = o sum_i w_i erf(t_i / (sigma_i sqrt 2)),   w_i = a_i G(l_i) (1 - |t_i| / tau)         (1)
/// o(x) = 1 - |sum_i w_i n_i| / sum_i w_i                                                       (2)
/// ```
///
/// with `t_i` the distance of x from the point's plane along its normal `n_i`, `l_i` that along the
/// plane, `a_i` the area that the point stands for, `G` a normal density in the plane, and `tau`
/// the reach. The taper lets the nearer of two sheets win, at any thickness between them (after
/// Splietker and Behnke 2019, Directional TSDF; the error function is the probability that x lies
/// behind a surface measured with noise, Curless and Levoy 1996). The opposition `o` is 1 between
/// sheets that face each other and 0 at one sheet alone: what lies behind that one, the winding
/// number decides, for which a stray sheet has no inside.
///
/// * `areas` - square metres, for each point of `cloud`
/// * `spacing` - distance between the points, metres
pub(super) fn add_votes(lattice: &mut Lattice, cloud: &Cloud, areas: &[f64], spacing: f64) {
    let min_sigma = MIN_SIGMA_LATTICE_SPACINGS * lattice.spacing;
    let lateral = LATERAL_SIGMA_SPACINGS * spacing;
    let reach = VOTE_REACH_SPACINGS * spacing;
    let mut sheets: Vec<Sheet> = (0..cloud.len())
        .map(|i| Sheet {
            point: cloud.points[i],
            normal: cloud.normals[i],
            // Points that stand alone must not weigh like a surface.
            weight: areas[i].min(spacing * spacing) / (2.0 * PI * lateral * lateral),
            sigma: cloud.sigma[i].max(min_sigma),
            lateral,
            reach,
        })
        .collect();
    sheets.sort_by(|a, b| a.point.z.total_cmp(&b.point.z));
    let radius = reach.hypot(MAX_LATERAL_SIGMAS * lateral);
    let (frame, plane) = (lattice.without_values(), lattice.size[0] * lattice.size[1]);
    lattice.values.par_chunks_mut(plane).enumerate().for_each(|(z, values)| {
        let height = frame.position(0, 0, z).z;
        let first = sheets.partition_point(|sheet| sheet.point.z < height - radius);
        let end = sheets.partition_point(|sheet| sheet.point.z <= height + radius);
        let mut votes = vec![CornerVotes::default(); plane];
        sheets[first..end].iter().for_each(|sheet| sheet.vote(&frame, z, radius, &mut votes));
        values.iter_mut().zip(&votes).for_each(|(value, votes)| *value += votes.opposed() as f32);
    });
}

/// The sums over the votes on one corner.
#[derive(Clone, Copy, Default)]
struct CornerVotes {
    /// Weighted sum of the sides, negative inside.
    side: f64,
    weight: f64,
    /// Weighted sum of the normals.
    normal: Vec3,
}

impl CornerVotes {
    /// The value of equation (1): the sum of the sides as far as the sheets face each other.
    fn opposed(&self) -> f64 {
        if self.weight > 0.0 {
            self.side * (1.0 - self.normal.norm() / self.weight) // (2)
        } else {
            0.0
        }
    }
}

/// A point and the piece of surface that it stands for; lengths in metres.
struct Sheet {
    point: Vec3,
    normal: Vec3,
    /// Area, divided by that of the lateral normal density.
    weight: f64,
    /// Standard deviation across the sheet.
    sigma: f64,
    /// Standard deviation along the sheet.
    lateral: f64,
    /// Half thickness of the layer in which the point votes.
    reach: f64,
}

impl Sheet {
    /// Adds to `votes` on slice `z` of `lattice`, for corners within `radius` (metres).
    fn vote(&self, lattice: &Lattice, z: usize, radius: f64, votes: &mut [CornerVotes]) {
        for y in self.corner_range(lattice, 1, radius) {
            for x in self.corner_range(lattice, 0, radius) {
                let offset = lattice.position(x, y, z) - self.point;
                let across = offset.dot(&self.normal);
                let along = (offset.norm_squared() - across * across) / self.lateral.powi(2);
                if across.abs() < self.reach && along < MAX_LATERAL_SIGMAS * MAX_LATERAL_SIGMAS {
                    let taper = 1.0 - across.abs() / self.reach;
                    let weight = self.weight * (-0.5 * along).exp() * taper; // (1)
                    let vote = &mut votes[y * lattice.size[0] + x];
                    vote.side += weight * erf(across / (self.sigma * SQRT_2)); // (1)
                    vote.weight += weight;
                    vote.normal += self.normal * weight;
                }
            }
        }
    }

    /// The corners along `axis` within `radius` (metres) of the point.
    fn corner_range(&self, lattice: &Lattice, axis: usize, radius: f64) -> Range<usize> {
        let middle = (self.point[axis] - lattice.origin[axis]) / lattice.spacing;
        let half = radius / lattice.spacing;
        let first = (middle - half).ceil().max(0.0) as usize;
        let end = ((middle + half).floor() + 1.0).max(0.0) as usize;
        first..end.min(lattice.size[axis])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sheets of points 1 apart at the heights `sheets`, with their normals up or down, and the
    /// votes about them.
    fn votes(sheets: &[(f64, f64)]) -> Lattice {
        let mut cloud = Cloud::default();
        for (z, up) in sheets {
            for i in 0..13 * 13 {
                let at = Vec3::new(f64::from(i % 13) - 6.0, f64::from(i / 13) - 6.0, *z);
                cloud.push(at, Vec3::z() * *up, 0.05, 2);
            }
        }
        let origin = Vec3::new(0.0, 0.0, -3.0);
        let size = [1, 1, 25];
        let mut lattice = Lattice { origin, spacing: 0.25, size, values: vec![0.0; 25] };
        add_votes(&mut lattice, &cloud, &vec![1.0; cloud.len()], 1.0);
        lattice
    }

    fn value_at(lattice: &Lattice, z: f64) -> f32 {
        lattice.values[((z + 3.0) / lattice.spacing).round() as usize]
    }

    #[test]
    fn a_wall_is_inside_between_its_sides_and_a_slot_outside() {
        for thickness in [0.5, 1.0, 1.5] {
            let wall = votes(&[(0.0, -1.0), (thickness, 1.0)]);
            assert!(value_at(&wall, thickness / 2.0) < -0.8, "{thickness}: {:?}", wall.values);
            assert!(value_at(&wall, thickness + 0.25) >= 0.0 && value_at(&wall, -0.25) >= 0.0);
            let slot = votes(&[(0.0, 1.0), (thickness, -1.0)]);
            for (a, b) in wall.values.iter().zip(&slot.values) {
                assert!((a + b).abs() < 1e-6);
            }
        }
        assert!(value_at(&votes(&[(0.0, -1.0), (0.5, 1.0)]), 0.75) > 0.1);
    }

    #[test]
    fn one_sheet_alone_decides_nothing() {
        let sheet = votes(&[(0.0, 1.0)]);
        assert!(sheet.values.iter().all(|v| v.abs() < 1e-6), "{:?}", sheet.values);
    }

    #[test]
    fn the_votes_of_two_points_are_those_of_the_equations() {
        // Two points that face each other across a gap of 1, and one corner above the lower one.
        let mut cloud = Cloud::default();
        cloud.push(Vec3::zeros(), -Vec3::z(), 0.4, 1);
        cloud.push(Vec3::z(), Vec3::z(), 0.4, 1);
        let origin = Vec3::new(0.3, 0.0, 0.25);
        let mut lattice = Lattice { origin, spacing: 1.0, size: [1, 1, 1], values: vec![0.0] };
        add_votes(&mut lattice, &cloud, &[0.5, 0.5], 1.0);
        let density = (-0.5 * (0.3_f64 / 0.6).powi(2)).exp() / (2.0 * PI * 0.36);
        let weights = [0.25, 0.75].map(|t: f64| 0.5 * density * (1.0 - t / 1.5));
        let sides = [0.25, 0.75].map(|t: f64| -erf(t / (0.4 * SQRT_2)));
        let opposition = 1.0 - (weights[1] - weights[0]).abs() / (weights[0] + weights[1]);
        let expected = opposition * (weights[0] * sides[0] + weights[1] * sides[1]);
        assert!((f64::from(lattice.values[0]) - expected).abs() < 1e-6, "{:?}", lattice.values);
    }
}
