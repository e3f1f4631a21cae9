//! Scans of objects with sharp edges must not be moved towards their sensors, which no residual
//! shows: the object would grow.

use super::sharp_shapes_tests::{Displacement, even_views, perturbed, shape, simulate_scan};
use super::*;
use crate::geometry::{Scan, Vec3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Uncertainty of a robot that knows its poses well.
const SIGMA: PoseSigma = PoseSigma { translation: 5e-4, rotation: 1e-3 };
/// Standard deviation along the rays, metres.
const NOISE: f64 = 5e-5;
/// Distance between points, metres.
const SPACING: f64 = 1.6e-3;

/// Displacements of a registration, mm.
struct Outcome {
    /// Mean along the views.
    along_views: f64,
    /// Root mean square.
    rms: f64,
    /// Root mean square at the robot's poses.
    robot_rms: f64,
    /// Reasons why scans were refused.
    refused: Vec<String>,
}

/// Ten views of a shape, registered from the true poses or from those of draw `seed`, whose errors
/// have the standard deviation `sigma`.
fn registered(name: &str, sigma: PoseSigma, seed: Option<u64>) -> Outcome {
    let mut rng = ChaCha8Rng::seed_from_u64(100 + seed.unwrap_or(1));
    let truth = even_views(10);
    let shape = shape(name);
    let scans: Vec<Scan> =
        truth.iter().map(|pose| simulate_scan(&shape, pose, SPACING, NOISE, &mut rng)).collect();
    let prepared: Vec<PreparedScan> =
        scans.iter().map(|scan| PreparedScan::new(scan).unwrap()).collect();
    let robot = seed
        .map_or(truth.clone(), |seed| perturbed(&truth, sigma.translation, sigma.rotation, seed));
    let params = RegisterParams::default();
    let found = register(&prepared, &robot, Some(sigma), &params, &Progress::silent()).unwrap();
    let refused = found.verdicts.iter().filter(|v| !v.is_accepted());
    let displacement = Displacement::new(&scans, &truth, &found.poses);
    Outcome {
        along_views: displacement.along_views * 1e3,
        rms: displacement.rms * 1e3,
        robot_rms: Displacement::new(&scans, &truth, &robot).rms * 1e3,
        refused: refused.map(|v| v.reason.clone()).collect(),
    }
}

#[test]
fn exact_poses_stay_where_they_are() {
    for name in ["box", "l", "wedge", "prism", "ribs", "cylinder", "sphere"] {
        let found = registered(name, SIGMA, None);
        assert!(found.refused.is_empty(), "{name}: {:?}", found.refused);
        // Ribs of 4 mm are two and a half points wide: their planes all reach round edges.
        let [max_along, max_rms] = if name == "ribs" { [0.4, 0.7] } else { [0.1, 0.2] };
        assert!(
            found.along_views.abs() < max_along,
            "{name}: moved by {} mm along the views",
            found.along_views
        );
        assert!(found.rms < max_rms, "{name}: moved by {} mm", found.rms);
    }
}

#[test]
fn directions_that_faces_leave_free_stay_with_the_robot_and_the_others_improve() {
    for (name, max_ratio) in [("box", 0.9), ("prism", 0.7), ("sphere", 0.5)] {
        let found = registered(name, SIGMA, Some(1));
        assert!(found.refused.is_empty(), "{name}: {:?}", found.refused);
        assert!(
            found.along_views.abs() < 0.3,
            "{name}: moved by {} mm along the views",
            found.along_views
        );
        let ratio = found.rms / found.robot_rms;
        assert!(ratio < max_ratio, "{name}: {} of {} mm", found.rms, found.robot_rms);
    }
}

#[test]
fn edges_determine_what_faces_leave_free_where_the_robot_knows_less() {
    let loose = PoseSigma { translation: 3e-3, rotation: 6e-3 };
    for (name, max_ratio) in [("box", 0.75), ("l", 0.75), ("prism", 0.6)] {
        let draws = [1, 2, 3].map(|seed| registered(name, loose, Some(seed)));
        let found = draws.iter().map(|draw| draw.rms).sum::<f64>() / 3.0;
        let robot = draws.iter().map(|draw| draw.robot_rms).sum::<f64>() / 3.0;
        println!("{name}: {found:.2} of {robot:.2} mm");
        assert!(found < max_ratio * robot, "{name}: {found} of {robot} mm");
    }
}

#[test]
fn a_scan_that_ties_two_others_joins_though_it_fits_only_one_of_them_at_first() {
    // The faces of a prism, of which a scan sees four, hold two neighbours in some directions only.
    let found = registered("prism", SIGMA, Some(2));
    assert!(found.refused.is_empty(), "{:?}", found.refused);
    assert!(found.rms < 0.8 * found.robot_rms, "{} of {} mm", found.rms, found.robot_rms);
}

#[test]
fn normals_do_not_reach_round_edges() {
    let (truth, shape) = (even_views(4), shape("box"));
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let (mut off, mut all) = (0, 0);
    for pose in &truth {
        let scan = simulate_scan(&shape, pose, SPACING, NOISE, &mut rng);
        let scan = PreparedScan::new(&scan).unwrap();
        for normal in &scan.normals {
            // A face of the box is across an axis.
            let seen: Vec3 = pose.rotation * normal;
            all += 1;
            off += usize::from(seen.amax() < 10_f64.to_radians().cos());
        }
    }
    assert!(all > 4000 && off * 50 < all, "{off} of {all}");
}
