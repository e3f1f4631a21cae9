use super::super::labels::GOOD_LABEL;
use super::super::tests::{Figures, above, blocked, slab, two_slabs};
use super::super::{NoiseFamily, SimulateParams, SimulatedView, Simulator};
use super::*;
use crate::mesh::Mesh;

fn simulate_scan(mesh: &Mesh, seed: u64, pose: &Pose) -> SimulatedView {
    let params = SimulateParams { family: NoiseFamily::P1, ..SimulateParams::default() };
    Simulator::new(mesh, &params, seed).unwrap().scan(0, pose)
}

/// Error of a good point along its ray.
fn error_along_ray(view: &SimulatedView, index: usize) -> Option<f64> {
    let point = view.scan.point(index).filter(|_| view.labels[index] == GOOD_LABEL)?;
    let hit = Vec3::from(view.hits[index].map(f64::from));
    Some((point - hit).dot(&(point - view.scan.origin(index)).normalize()))
}

/// Errors along the ray of the good points, less the mean of their profile (which is the sweep's
/// jitter); and those means.
fn errors(view: &SimulatedView) -> (Vec<f64>, Vec<f64>) {
    let (mut errors, mut means) = (Vec::new(), Vec::new());
    for row in 0..view.scan.height() {
        let row: Vec<f64> = (row * PROFILE_POINTS..(row + 1) * PROFILE_POINTS)
            .filter_map(|i| error_along_ray(view, i))
            .collect();
        if row.len() > 30 {
            let mean = Figures::new(&row).mean;
            errors.extend(row.iter().map(|e| e - mean));
            means.push(mean);
        }
    }
    (errors, means)
}

#[test]
fn noise_is_0_05_mm_head_on_and_0_2_mm_grazing() {
    // Thin, so that its sides give hardly any points.
    let mesh = slab(0.05, 0.05, 0.0005);
    for (degrees, low, high) in [(0.0, 0.049, 0.052), (60.0, 0.09, 0.11), (82.0, 0.18, 0.21)] {
        let (errors, _) = errors(&simulate_scan(&mesh, 1, &above(0.3, degrees)));
        let sigma = Figures::new(&errors).deviation * 1e3;
        assert!(errors.len() > 5_000 && (low..high).contains(&sigma), "{degrees}: {sigma} mm");
    }
}

#[test]
fn the_sweep_wanders_0_007_mm_a_profile() {
    let mesh = slab(0.05, 0.05, 0.01);
    let (mut steps, mut ends) = (Vec::new(), Vec::new());
    for seed in 0..20 {
        let params = SimulateParams::default();
        let scene = SimulatedScene::new(&mesh, &Mesh::default()).unwrap();
        let walk = Striper::new(fit_model(&scene, &params), &scene)
            .draw_random_walk(RandomSource { seed, view: 0 });
        steps.extend(walk.windows(2).map(|w| (w[1] - w[0]).norm_squared() / 3.0));
        ends.push(walk[0].norm_squared() / 3.0 / (walk.len() / 2) as f64);
        assert_eq!(walk[walk.len() / 2], Vec3::zeros());
    }
    let step = Figures::new(&steps).mean.sqrt() * 1e3;
    assert!((step - 0.007).abs() < 3e-4, "{step}");
    // A walk, not white noise: its square grows with the number of steps.
    let end = Figures::new(&ends).mean.sqrt() * 1e3;
    assert!((0.004..0.011).contains(&end), "{end}");
    let (_, means) = errors(&simulate_scan(&mesh, 1, &above(0.3, 0.0)));
    assert!(Figures::new(&means).deviation > 0.01e-3, "the points do not show the jitter");
}

#[test]
fn one_point_in_2000_is_an_outlier() {
    let mesh = slab(0.05, 0.05, 0.01);
    let (mut outliers, mut returns) = (0, 0);
    for seed in 0..6 {
        let view = simulate_scan(&mesh, seed, &above(0.3, 0.0));
        for i in view.scan.returns() {
            returns += 1;
            outliers += usize::from(view.labels[i] == OUTLIER_LABEL);
        }
    }
    let share = outliers as f64 / returns as f64;
    assert!((0.00038..0.00062).contains(&share), "{outliers} of {returns}");
}

#[test]
fn laser_and_camera_both_see_each_point_and_the_rest_is_shadow() {
    let mesh = two_slabs();
    let view = simulate_scan(&mesh, 1, &above(0.3, 0.0));
    let (mut shadow, mut behind) = (0, 0);
    for i in 0..view.scan.points.len() {
        let laser = view.scan.origin(i);
        let ray = view_ray(i);
        // Where the ray meets the lower slab, whose top is 0.3 m away.
        let point = laser + ray * (0.3 / ray.z);
        if point.x.abs() > 0.058 || point.y.abs() > 0.058 {
            continue;
        }
        let (unseen, hidden) =
            (blocked(&laser, &point), blocked(&(laser - Vec3::y() * 0.12), &point));
        let hit = view.hits[i][2];
        if unseen == Some(false) && hidden == Some(true) {
            assert!(hit.is_nan(), "{point:?} lies in the camera's shadow");
            shadow += 1;
        }
        if unseen == Some(true) {
            assert!(hit.is_nan() || hit < 0.27, "{point:?} lies behind the upper slab");
            behind += 1;
        }
        if unseen == Some(false) && hidden == Some(false) {
            assert!((hit - 0.3).abs() < 1e-3, "{point:?} should be seen");
        }
    }
    assert!(shadow > 500 && behind > 500, "{shadow} in the shadow, {behind} behind");
    let flying = view.labels.iter().filter(|&&l| l == FLYING_LABEL).count();
    assert!(flying > 50, "{flying} flying points");
}

fn view_ray(index: usize) -> Vec3 {
    let scene = SimulatedScene::new(&two_slabs(), &Mesh::default()).unwrap();
    Striper::new(fit_model(&scene, &SimulateParams::default()), &scene).ray(index % PROFILE_POINTS)
}

#[test]
fn the_model_covers_the_object_with_the_stated_spacings() {
    let params = SimulateParams::default();
    let small = SimulatedScene::new(&slab(0.03, 0.03, 0.01), &Mesh::default()).unwrap();
    let model = fit_model(&small, &params);
    assert_eq!(model.working_distance, params.laser_distance);
    assert_eq!((model.point_spacing, model.profile_spacing), (0.35e-3, 0.5e-3));
    let length = (model.profiles - 1) as f64 * model.profile_spacing;
    let sweep = 2.0 * (small.radius() + SWEEP_OVERRUN);
    assert!(length >= sweep && length < sweep + model.profile_spacing);
    // An object wider than the fan: everything grows by the same factor.
    let large = SimulatedScene::new(&slab(0.3, 0.3, 0.01), &Mesh::default()).unwrap();
    let model = fit_model(&large, &params);
    let scale = model.point_spacing / params.point_spacing;
    assert!(scale > 1.0 && (model.profile_spacing / params.profile_spacing - scale).abs() < 1e-12);
    let width = PROFILE_POINTS as f64 * model.point_spacing;
    assert!((width - 2.0 * (large.radius() + SWEEP_OVERRUN)).abs() < 1e-9);
    assert!((model.working_distance - params.laser_distance * scale).abs() < 1e-12);
}

#[test]
fn the_sigma_grows_with_the_incidence_up_to_its_largest() {
    assert_eq!(range_sigma(1.0), 0.05e-3);
    assert!((range_sigma(0.5) - 0.1e-3).abs() < 1e-12);
    assert_eq!(range_sigma(0.1), 0.2e-3);
}
