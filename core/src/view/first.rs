//! Views that need no knowledge of the object.

use super::looking_along;
use crate::geometry::{Pose, Vec3};

/// Directions from which to look first: azimuth in steps of 45 degrees from the front (-y), elevated by these angles.
const ELEVATIONS: [f64; 5] = [30.0, 60.0, 5.0, -30.0, -60.0];
const STEPS: usize = 8;

/// Predefined views of `middle` from `distance` (metres) in the order in which they are tried.
pub(crate) fn predefined(middle: &Vec3, distance: f64) -> Vec<Pose> {
    let ring = |elevation: f64| {
        (0..STEPS).map(move |i| {
            let azimuth = (i as f64 / STEPS as f64 * 360.0 - 90.0).to_radians();
            let (up, out) = elevation.to_radians().sin_cos();
            Vec3::new(out * azimuth.cos(), out * azimuth.sin(), up)
        })
    };
    let views = ELEVATIONS.into_iter().flat_map(ring).chain([Vec3::z(), -Vec3::z()]);
    views.map(|d| looking_along(&(middle + d * distance), &-d)).collect()
}

/// Number of directions of the evenly spread baseline.
const SPREAD: usize = 64;

/// Views of `middle` from `distance` (metres) spread evenly over the sphere (Fibonacci lattice), each as far as
/// possible from those before it.
pub(crate) fn spread(middle: &Vec3, distance: f64) -> Vec<Pose> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let mut left: Vec<Vec3> = (0..SPREAD)
        .map(|i| {
            let z = 1.0 - (2 * i + 1) as f64 / SPREAD as f64;
            let (sin, cos) = (i as f64 * golden).sin_cos();
            Vec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + Vec3::z() * z
        })
        .collect();
    let mut taken: Vec<Vec3> = Vec::new();
    while !left.is_empty() {
        let nearest = |d: &Vec3| taken.iter().map(|t| t.dot(d)).fold(-1.0, f64::max);
        let next = (0..left.len()).min_by(|&a, &b| nearest(&left[a]).total_cmp(&nearest(&left[b])));
        taken.push(left.remove(next.unwrap_or(0)));
    }
    taken.iter().map(|d| looking_along(&(middle + d * distance), &-d)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_look_at_the_middle_and_the_first_is_in_front_and_elevated() {
        let middle = Vec3::new(0.1, 0.2, 0.3);
        let (predefined, spread) = (predefined(&middle, 0.5), spread(&middle, 0.5));
        assert_eq!((predefined.len(), spread.len()), (42, 64));
        for pose in predefined.iter().chain(&spread) {
            assert!((pose * nalgebra::Point3::new(0.0, 0.0, 0.5) - middle).coords.norm() < 1e-9);
        }
        let first = predefined[0].translation.vector - middle;
        assert!((first - Vec3::new(0.0, -0.433_013, 0.25)).norm() < 1e-5);
        // Any half of the sphere is looked at early: the first six are well apart.
        for i in 1..6 {
            for j in 0..i {
                let direction = |k: usize| spread[k].rotation * Vec3::z();
                assert!(direction(i).angle(&direction(j)).to_degrees() > 45.0);
            }
        }
    }
}
