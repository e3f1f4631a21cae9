use super::super::labels::GOOD_LABEL;
use super::super::tests::{Figures, above, blocked, slab, two_slabs};
use super::super::{NoiseFamily, SimulateParams, SimulatedView, Simulator};
use super::*;
use crate::mesh::Mesh;

fn simulate_scan(mesh: &Mesh, seed: u64, pose: &Pose) -> SimulatedView {
    let params = SimulateParams { family: NoiseFamily::P3, ..SimulateParams::default() };
    Simulator::new(mesh, &params, seed).unwrap().scan(0, pose)
}

/// Depth error of a good point.
fn error(view: &SimulatedView, index: usize) -> Option<f64> {
    let point = view.scan.point(index).filter(|_| view.labels[index] == GOOD_LABEL)?;
    Some(point.z - f64::from(view.hits[index][2]))
}

fn correlation(view: &SimulatedView, step: usize) -> f64 {
    let pairs = (0..view.labels.len() - step)
        .filter(|i| i % GRID_SIZE[0] + step < GRID_SIZE[0])
        .filter_map(|i| Some((error(view, i)?, error(view, i + step)?)));
    let (mut product, mut squares) = (0.0, 0.0);
    for (a, b) in pairs {
        product += a * b;
        squares += (a * a + b * b) / 2.0;
    }
    product / squares
}

#[test]
fn depth_noise_is_1_3_mm_correlated_and_quantised() {
    let view = simulate_scan(&slab(0.4, 0.4, 0.01), 1, &above(0.65, 0.0));
    let errors: Vec<f64> = (0..view.labels.len()).filter_map(|i| error(&view, i)).collect();
    let sigma = Figures::new(&errors).deviation * 1e3;
    assert!(errors.len() > 50_000 && (1.2..1.55).contains(&sigma), "{sigma} mm");
    let near = correlation(&view, 1);
    assert!((0.7..0.85).contains(&near), "{near}");
    let far = correlation(&view, 6);
    assert!((0.15..0.45).contains(&far), "{far}");
    assert!(correlation(&view, 24).abs() < 0.12);
    for i in view.scan.returns() {
        let sixteenths = focal_length() * BASELINE_M / view.scan.point(i).unwrap().z * 16.0;
        assert!((sixteenths - sixteenths.round()).abs() < 0.01, "{sixteenths}");
    }
}

#[test]
fn one_point_in_100_is_an_outlier() {
    let view = simulate_scan(&slab(0.4, 0.4, 0.01), 1, &above(0.65, 0.0));
    let outliers = view.labels.iter().filter(|&&l| l == OUTLIER_LABEL).count();
    let share = outliers as f64 / view.scan.returns().count() as f64;
    assert!((0.0085..0.0115).contains(&share), "{share}");
}

#[test]
fn points_drop_out_from_50_degrees_and_none_is_left_past_75() {
    // Large, so that the middle of the image shows none of its sides.
    let mesh = slab(0.4, 0.4, 0.02);
    let [steep, slanted, grazing] = [45.0, 62.5, 80.0]
        .map(|degrees| central_return_share(&simulate_scan(&mesh, 1, &above(0.65, degrees))));
    assert_eq!(steep, 1.0);
    assert!((0.3..0.7).contains(&slanted), "{slanted}");
    assert_eq!(grazing, 0.0);
}

/// Share of the pixels in the middle of the image that have a return.
fn central_return_share(view: &SimulatedView) -> f64 {
    let pixels: Vec<usize> = (0..view.labels.len())
        .filter(|&i| {
            let (x, y) = (i % GRID_SIZE[0], i / GRID_SIZE[0]);
            x.abs_diff(160) < 20 && y.abs_diff(120) < 10
        })
        .collect();
    let seen = pixels.iter().filter(|&&i| view.scan.point(i).is_some()).count();
    seen as f64 / pixels.len() as f64
}

#[test]
fn slanted_surfaces_are_measured_worse() {
    let mesh = slab(0.1, 0.1, 0.02);
    let [slanted, normal] = [45.0, 0.0].map(|degrees| {
        let view = simulate_scan(&mesh, 1, &above(0.65, degrees));
        let errors: Vec<f64> = (0..view.labels.len()).filter_map(|i| error(&view, i)).collect();
        Figures::new(&errors).deviation
    });
    let ratio = slanted / normal;
    assert!((1.5..1.9).contains(&ratio), "{ratio}");
}

#[test]
fn both_cameras_see_each_point_and_half_of_the_edges_fly() {
    let view = simulate_scan(&two_slabs(), 1, &above(0.65, 0.0));
    let (mut hidden, mut behind, mut edges, mut flying) = (0, 0, 0, 0);
    for i in 0..view.labels.len() {
        let hit = view.hits[i];
        let point = ray(i) * 0.65;
        if point.x.abs() < 0.058 && point.y.abs() < 0.058 {
            let left = blocked_at(&Vec3::zeros(), &point);
            let right = blocked_at(&(Vec3::x() * BASELINE_M), &point);
            if left == Some(true) {
                assert!(hit[2].is_nan() || hit[2] < 0.62, "{point:?} lies behind the upper slab");
                behind += 1;
            } else if left == Some(false) && right == Some(true) {
                assert!(hit[2].is_nan(), "{point:?} is hidden from the right camera");
                hidden += 1;
            }
        }
        let (x, y) = (i % GRID_SIZE[0], i / GRID_SIZE[0]);
        if x > 0 && y > 0 && x + 1 < GRID_SIZE[0] && y + 1 < GRID_SIZE[1] && hit[2].is_finite() {
            let others =
                [i - 1, i + 1, i - GRID_SIZE[0], i + GRID_SIZE[0]].map(|j| view.hits[j][2]);
            if others.iter().any(|&z| z.is_nan() || (z - hit[2]).abs() > 8e-3) {
                edges += 1;
                flying += usize::from(view.labels[i] == FLYING_LABEL);
            } else {
                assert_ne!(view.labels[i], FLYING_LABEL);
            }
        }
    }
    assert!(hidden > 30 && behind > 200, "{hidden} hidden, {behind} behind");
    let share = flying as f64 / edges as f64;
    assert!(edges > 200 && (0.4..0.6).contains(&share), "{flying} of {edges}");
}

/// As `blocked`, for the lower slab's top 0.65 m away.
fn blocked_at(eye: &Vec3, point: &Vec3) -> Option<bool> {
    let nearer = Vec3::z() * 0.35;
    blocked(&(eye - nearer), &(point - nearer))
}

#[test]
fn the_stated_sigma_follows_from_the_disparity_noise() {
    // The derivative of z = f b / d at 0.65 m, by finite differences.
    let disparity = focal_length() * BASELINE_M / 0.65;
    let [near, far] = [1e-4, -1e-4].map(|step| focal_length() * BASELINE_M / (disparity + step));
    let slope = (far - near) / 2e-4;
    let noise =
        (WHITE_SIGMA.powi(2) + CORRELATED_SIGMA.powi(2) + DISPARITY_STEP.powi(2) / 12.0).sqrt();
    assert!((depth_sigma(0.65, 1.0) / (slope * noise) - 1.0).abs() < 1e-6);
    // Noise grows with the square of the depth.
    assert!((depth_sigma(1.3, 1.0) / depth_sigma(0.65, 1.0) - 4.0).abs() < 1e-12);
    assert!((depth_correlation(0.0, 0.0) - 0.8).abs() < 1e-12);
    assert!((depth_correlation(0.0, 6.0) - 0.8 / std::f64::consts::E).abs() < 1e-12);
}

#[test]
fn drop_out_is_linear_between_its_angles() {
    for (degrees, expected) in [(0.0, 0.0), (50.0, 0.0), (62.5, 0.5), (75.0, 1.0), (89.0, 1.0)] {
        let probability = drop_out_probability(f64::to_radians(degrees).cos());
        assert!((probability - expected).abs() < 1e-9, "{degrees}: {probability}");
    }
}
