//! Scans of a ball, matched with its true surface.

use super::surfels::{Surfels, measure};
use crate::geometry::{Pose, Scan, Vec3};
use crate::register::params::RegisterParams;
use crate::register::registration_scan::RegistrationScan;
use crate::register::strategy::Strategy;
use crate::scan::{PoseSigma, PreparedScan};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Radius of the ball, metres.
const RADIUS: f64 = 0.05;
const NOISE: f64 = 1.5e-3;
const EXACT: PoseSigma = PoseSigma { translation: 0.0, rotation: 0.0 };

/// A ball before a camera 0.5 m away, with noise along the rays and ever fewer points towards
/// its outline.
fn ball(rng: &mut ChaCha8Rng) -> PreparedScan {
    let mut points = Vec::new();
    for i in 0..200 * 200 {
        let (x, y) = ((i % 200) as f64 * 6e-4 - 0.06, (i / 200) as f64 * 6e-4 - 0.06);
        let ray = Vec3::new(x, y, 0.5).normalize();
        let along = ray.z * 0.5;
        let inside = RADIUS * RADIUS - (0.25 - along * along);
        if inside < 0.0 {
            continue;
        }
        let depth = along - inside.sqrt();
        let incidence = (inside.sqrt() / RADIUS).acos().to_degrees();
        if rng.random_bool(((incidence - 50.0) / 25.0).clamp(0.0, 1.0)) {
            continue;
        }
        let noise: f64 = rng.sample(StandardNormal);
        let point = ray * (depth + NOISE * noise);
        points.push([point.x as f32, point.y as f32, point.z as f32]);
    }
    PreparedScan::new(&Scan { points, ..Scan::default() }).unwrap()
}

#[test]
fn noise_along_the_rays_does_not_push_the_outline_inwards() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let strategy = Strategy::new(&RegisterParams::default());
    let sample = RegistrationScan::new(&ball(&mut rng), EXACT, &strategy);
    // The true surface as surfels.
    let center = Vec3::z() * 0.5;
    let normals: Vec<Vec3> = (0..600)
        .map(|i| {
            // Golden-angle spiral.
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 600.0;
            let angle = 2.399963 * f64::from(i);
            let r = (1.0 - z * z).sqrt();
            Vec3::new(r * angle.cos(), r * angle.sin(), z)
        })
        .collect();
    let centers = normals.iter().map(|n| center + n * RADIUS).collect();
    let surfels = Surfels::from_oriented_points(centers, normals, 8e-3);
    let points = surfels.match_points(&sample, &Pose::identity(), 8e-3, 0.5);
    let measurements = measure(&points, 8e-3);
    let outline = measurements.iter().filter(|t| {
        let ray = surfels.centers[t.surfel as usize].normalize();
        (-surfels.normals[t.surfel as usize].dot(&ray)).acos().to_degrees() > 55.0
    });
    let (sum, weight) =
        outline.fold((0.0, 0.0), |(s, w), t| (s + t.weight * t.residual, w + t.weight));
    assert!(weight > 500.0, "{weight}");
    assert!((sum / weight).abs() < 0.08e-3, "{} mm", sum / weight * 1e3);
}
