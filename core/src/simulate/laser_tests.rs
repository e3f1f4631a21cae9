use super::super::tests::{Figures, above, blocked, slab, two_slabs};
use super::super::{NoiseFamily, SimulateParams, SimulatedView, Simulator};
use super::*;
use crate::mesh::Mesh;

fn look(mesh: &Mesh, seed: u64, pose: &Pose) -> SimulatedView {
    let params = SimulateParams { family: NoiseFamily::P1, ..SimulateParams::default() };
    Simulator::new(mesh, &params, seed).unwrap().scan(0, pose)
}

/// Errors along the ray of the good points, less the mean of their profile (which is the sweep's jitter);
/// and those means.
fn errors(view: &SimulatedView) -> (Vec<f64>, Vec<f64>) {
    let (mut errors, mut means) = (Vec::new(), Vec::new());
    for row in 0..view.scan.height() {
        let good = |i: &usize| view.scan.point(*i).is_some() && view.labels[*i] == GOOD;
        let along = |i: usize| {
            let (hit, point) = (Vec3::from(view.hits[i].map(f64::from)), view.scan.point(i)?);
            Some((point - hit).dot(&(point - view.scan.origin(i)).normalize()))
        };
        let row: Vec<f64> =
            (row * POINTS..(row + 1) * POINTS).filter(good).filter_map(along).collect();
        if row.len() > 30 {
            let mean = Figures::of(&row).mean;
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
        let (errors, _) = errors(&look(&mesh, 1, &above(0.3, degrees)));
        let sigma = Figures::of(&errors).deviation * 1e3;
        assert!(errors.len() > 5_000 && (low..high).contains(&sigma), "{degrees}: {sigma} mm");
    }
}

#[test]
fn the_sweep_wanders_0_007_mm_a_profile() {
    let mesh = slab(0.05, 0.05, 0.01);
    let (mut steps, mut ends) = (Vec::new(), Vec::new());
    for seed in 0..20 {
        let params = SimulateParams::default();
        let scene = Scene::new(&mesh, &Mesh::default()).unwrap();
        let walk = Striper::new(model_for(&scene, &params), &scene).wander(Dice { seed, view: 0 });
        steps.extend(walk.windows(2).map(|w| (w[1] - w[0]).norm_squared() / 3.0));
        ends.push(walk[0].norm_squared() / 3.0 / (walk.len() / 2) as f64);
        assert_eq!(walk[walk.len() / 2], Vec3::zeros());
    }
    let step = Figures::of(&steps).mean.sqrt() * 1e3;
    assert!((step - 0.007).abs() < 3e-4, "{step}");
    // A walk, not white noise: its square grows with the number of steps.
    let end = Figures::of(&ends).mean.sqrt() * 1e3;
    assert!((0.004..0.011).contains(&end), "{end}");
    let (_, means) = errors(&look(&mesh, 1, &above(0.3, 0.0)));
    assert!(Figures::of(&means).deviation > 0.01e-3, "the points do not show the jitter");
}

#[test]
fn one_point_in_2000_is_an_outlier() {
    let mesh = slab(0.05, 0.05, 0.01);
    let (mut outliers, mut returns) = (0, 0);
    for seed in 0..6 {
        let view = look(&mesh, seed, &above(0.3, 0.0));
        for i in view.scan.returns() {
            returns += 1;
            outliers += usize::from(view.labels[i] == OUTLIER);
        }
    }
    let share = outliers as f64 / returns as f64;
    assert!((0.00038..0.00062).contains(&share), "{outliers} of {returns}");
}

#[test]
fn laser_and_camera_both_see_each_point_and_the_rest_is_shadow() {
    let mesh = two_slabs();
    let view = look(&mesh, 1, &above(0.3, 0.0));
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
    let flying = view.labels.iter().filter(|&&l| l == FLYING).count();
    assert!(flying > 50, "{flying} flying points");
}

fn view_ray(index: usize) -> Vec3 {
    let scene = Scene::new(&two_slabs(), &Mesh::default()).unwrap();
    Striper::new(model_for(&scene, &SimulateParams::default()), &scene).ray(index % POINTS)
}
