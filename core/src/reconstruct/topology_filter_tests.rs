use super::*;
use crate::geometry::{Aabb, Vec3};
use crate::mesh::isosurface::tests::assert_manifold;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const MARGIN: f32 = 0.25;

/// A field clamped to a whole vote on each side, on a lattice of about 40 corners a side.
fn lattice(field: impl Fn(&Vec3) -> f64 + Sync) -> Lattice {
    let bounds = Aabb { min: Vec3::repeat(-1.5), max: Vec3::repeat(1.5) };
    Lattice::sample(&bounds, 0.075, |p| field(p).clamp(-1.0, 1.0))
}

/// Euler number and number of components after the filter.
fn filtered(mut lattice: Lattice, bodies: usize) -> (i64, usize) {
    filter_topology(&mut lattice, MARGIN, bodies);
    assert_manifold(&lattice.extract_isosurface())
}

/// A ring about the z axis, in votes a whole one of which is 0.2 thick.
fn ring(p: &Vec3) -> f64 {
    ((p.xy().norm() - 0.9).hypot(p.z) - 0.35) / 0.2
}

#[test]
fn what_is_clear_stays_as_it_is() {
    assert_eq!(filtered(lattice(|p| (p.norm() - 1.0) / 0.2), 1), (2, 1));
    let clear = lattice(ring);
    let mut after = clear.clone();
    filter_topology(&mut after, MARGIN, 1);
    assert_eq!(assert_manifold(&after.extract_isosurface()), (0, 1));
    assert_eq!(after, clear);
}

/// The ring, open at one place: `strength` is the value in the gap.
fn bridged(strength: f64) -> Lattice {
    lattice(|p| {
        let gap = p.y > 0.0 && p.x.abs() < 0.15;
        if gap && ring(p) < 0.0 { strength } else { ring(p) }
    })
}

/// The ring with a disc in its hole: `strength` is the value in the disc.
fn plugged(strength: f64) -> Lattice {
    lattice(|p| if p.xy().norm() < 0.7 && p.z.abs() < 0.2 { strength } else { ring(p) })
}

/// Two balls with `bridge` as the largest value in a neck between them.
fn balls(bridge: f64) -> Lattice {
    lattice(|p| {
        let left = (p + Vec3::x() * 0.7).norm() - 0.5;
        let both = left.min((p - Vec3::x() * 0.7).norm() - 0.4) / 0.2;
        if p.yz().norm() < 0.15 && p.x.abs() < 0.7 { both.min(bridge) } else { both }
    })
}

#[test]
fn a_weak_bridge_is_cut_and_a_weak_hole_is_filled() {
    assert_eq!(filtered(bridged(-0.1), 1), (2, 1), "a handle that is hardly there");
    assert_eq!(filtered(bridged(0.1), 1), (2, 1), "a gap that is hardly there closes no loop");
    assert_eq!(filtered(bridged(-0.5), 1), (0, 1), "a handle that is there");
    assert_eq!(filtered(plugged(0.1), 1), (2, 1), "a hole that is hardly there");
    assert_eq!(filtered(plugged(0.5), 1), (0, 1), "a hole that is there");
}

#[test]
fn bodies_merge_only_inside_and_the_largest_are_kept() {
    assert_eq!(filtered(balls(0.1), 2), (4, 2));
    assert_eq!(filtered(balls(0.1), 1), (2, 1));
    assert_eq!(filtered(balls(-0.1), 2), (2, 1));
    // A speck is no body.
    let speck = lattice(|p| ((p - Vec3::repeat(1.2)).norm() - 0.1).min(p.norm() - 0.9) / 0.05);
    assert_eq!(filtered(speck, 5), (2, 1));
}

#[test]
fn a_body_that_nothing_supports_by_the_whole_margin_is_there_all_the_same() {
    // As of scans from one side only: everywhere close to the border.
    let weak = lattice(|p| (p.norm() - 1.0).clamp(-0.1, 1.0));
    assert_eq!(filtered(weak, 1), (2, 1));
    assert_eq!(filtered(lattice(|p| p.norm() + 0.1), 1), (0, 0));
}

#[test]
fn voids_are_filled_whatever_their_value() {
    let hollow = lattice(|p| ((p.norm() - 0.8).abs() - 0.4) / 0.2);
    assert_eq!(filtered(hollow, 1), (2, 1));
}

/// The ball or the ring in noise up to `amplitude`, and its Euler number without.
fn noisy(seed: u64, amplitude: f32) -> (Lattice, i64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let is_ball = seed.is_multiple_of(2);
    let mut noisy = lattice(|p| if is_ball { (p.norm() - 1.0) / 0.2 } else { ring(p) });
    for value in &mut noisy.values {
        *value += random.random_range(-amplitude..amplitude);
    }
    (noisy, if is_ball { 2 } else { 0 })
}

#[test]
fn noise_within_the_margin_makes_no_loops_and_stronger_noise_few() {
    for seed in 0..10 {
        let (weak, expected) = noisy(seed, MARGIN);
        assert_eq!(filtered(weak, 1), (expected, 1));
        let (strong, expected) = noisy(seed, 0.6);
        let (raw, _) = assert_manifold(&strong.extract_isosurface());
        let (euler, bodies) = filtered(strong, 1);
        let loops = (euler - expected).abs();
        assert!(bodies == 1 && loops * 4 < (raw - expected).abs(), "{raw} became {euler}");
    }
}

#[test]
fn whatever_the_values_are_the_outcome_is_manifold() {
    for seed in 0..20 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let values = (0..12 * 11 * 10).map(|_| random.random_range(-1.0..1.0)).collect();
        let spacing = 1.0;
        let any = Lattice { spacing, size: [12, 11, 10], values, ..Lattice::default() };
        filtered(any, 3);
    }
}
