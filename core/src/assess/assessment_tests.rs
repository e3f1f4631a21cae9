//! Analytic cases of the whole assessment.

use super::*;
use crate::geometry::{Twist, exp};
use crate::mesh::test_shapes::{cuboid, sphere, torus, union};

fn measure(result: &Mesh, truth: &Mesh) -> Assessment {
    measure_with(result, truth, AssessParams::default())
}

fn measure_with(result: &Mesh, truth: &Mesh, params: AssessParams) -> Assessment {
    let params = AssessParams { samples: 20_000, seed: 3, ..params };
    assess(result, truth, &params, &Progress::silent()).unwrap()
}

fn close(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value} is not {expected}");
}

#[test]
fn concentric_spheres_are_as_far_apart_as_their_radii() {
    let found = measure(&sphere(0.0515, 5), &sphere(0.05, 5));
    // A facet's sagitta is 0.006 mm.
    for distances in [found.aligned, found.raw.0] {
        for value in [
            distances.accuracy_mean,
            distances.accuracy_rms,
            distances.accuracy_90,
            distances.completeness_mean,
            distances.completeness_rms,
            distances.completeness_90,
            distances.chamfer,
            distances.hausdorff,
        ] {
            close(value, 1.5, 0.02);
        }
        assert_eq!(distances.f_1mm, 0.0);
        close(distances.normal_consistency, 1.0, 1e-3);
    }
    assert_eq!(
        (found.crms_mean, found.crms_rms),
        (found.aligned.accuracy_mean, found.aligned.accuracy_rms)
    );
    assert_eq!((found.holes, found.double_surface), (0.0, 0.0));
    let t = found.topology;
    assert!(t.closed && t.two_manifold && t.oriented && t.outward == Some(true));
    assert_eq!((t.self_intersecting_faces, t.genus, t.components), (0, Some(0), 1));
    assert!(t.min_angle_p1 > 45.0 && t.min_angle_above_20 == 1.0);
    assert_eq!(found.within_1_sigma, None);
}

#[test]
fn a_shifted_sphere_and_a_turned_box_come_back() {
    let mut shifted = sphere(0.05, 5);
    shifted.vertices.iter_mut().for_each(|v| *v += Vec3::new(0.003, 0.0, 0.001));
    let found = measure(&shifted, &sphere(0.05, 5));
    assert!(found.crms_rms < 0.01, "{}", found.crms_rms);
    close(found.alignment_translation, 10f64.sqrt(), 0.01);
    // The mean of |cos| over a sphere is a half.
    close(found.raw.0.accuracy_mean, 10f64.sqrt() / 2.0, 0.05);

    let truth = cuboid(Vec3::zeros(), Vec3::new(0.1, 0.07, 0.05));
    let turned = truth.transformed(&exp(&Twist::new(0.002, 0.0, 0.0, 0.0, 0.0, 0.05)));
    let found = measure(&turned, &truth);
    assert!(found.aligned.hausdorff < 1e-3 && found.raw.0.hausdorff > 2.0);
    close(found.alignment_rotation, 0.05f64.to_degrees(), 1e-3);
    close(found.aligned.normal_consistency, 1.0, 1e-9);
}

#[test]
fn a_missing_face_is_a_hole_of_known_share() {
    let truth = cuboid(Vec3::zeros(), Vec3::repeat(0.1));
    let mut open = truth.clone();
    open.triangles.drain(2..4);
    let seen: Vec<Vec3> =
        sample_surface(&open, 40_000, 9, 0).unwrap().iter().map(|s| s.point).collect();
    let found =
        measure_with(&open, &truth, AssessParams { seen: Some(seen), ..AssessParams::default() });
    assert!(!found.topology.closed && found.topology.two_manifold);
    assert_eq!((found.topology.genus, found.topology.outward), (None, None));
    close(found.aligned.accuracy_rms, 0.0, 1e-9);
    // Farther than 2 mm from all four sides of the face: 0.96^2 of a sixth.
    close(found.holes, 0.96 * 0.96 / 6.0, 2e-3);
    close(found.aligned.hausdorff, 50.0, 1.5);
    close(found.aligned.completeness_mean, 100.0 / 6.0 / 6.0, 0.03);
    // A rim of twice the spacing, sqrt(0.06 m2 / 20,000), lies near seen points; the face's middle
    // does not.
    let rim = 1.0 - (1.0 - 2.0 * 0.00346 / 0.1f64).powi(2);
    close(found.seen_share.unwrap(), (5.0 + rim) / 6.0, 4e-3);
    assert!(found.completeness_seen_rms.unwrap() < 0.5 && found.holes_seen.unwrap() < 0.02);
}

#[test]
fn a_flipped_triangle_and_a_second_layer_are_seen() {
    let truth = sphere(0.05, 4);
    let mut flipped = truth.clone();
    flipped.triangles[9].swap(0, 1);
    let found = measure(&flipped, &truth);
    assert!(!found.topology.oriented && found.topology.genus.is_none());
    close(found.aligned.normal_consistency, 1.0, 1e-6);

    let double = union(&truth, &sphere(0.048, 4));
    let params = AssessParams { noise_sigma: Some(2e-4), ..AssessParams::default() };
    let found = measure_with(&double, &truth, params);
    close(found.double_surface, 0.048 * 0.048 / (0.048 * 0.048 + 0.05 * 0.05), 0.02);
    assert_eq!((found.topology.components, found.topology.genus), (2, Some(0)));
}

#[test]
fn an_open_truth_leaves_out_what_lies_beyond_its_rim() {
    let result = cuboid(Vec3::zeros(), Vec3::repeat(0.1));
    let mut truth = result.clone();
    truth.triangles.drain(2..4);
    let found = measure(&result, &truth);
    assert!(found.aligned.accuracy_mean > 1.0);
    close(found.accuracy_covered_rms.unwrap(), 0.0, 1e-6);
    close(found.covered_share.unwrap(), 5.0 / 6.0, 2e-3);
    assert_eq!(measure(&truth, &result).covered_share, None);
}

#[test]
fn the_bytes_are_the_same_for_any_number_of_threads() {
    let mut result = torus(0.06, 0.02, 60, 30);
    for (i, vertex) in result.vertices.iter_mut().enumerate() {
        *vertex += Vec3::new((i as f64).sin(), (i as f64 * 1.7).cos(), 1.0) * 5e-4;
    }
    result.sigma = vec![5e-4; result.vertices.len()];
    let truth = torus(0.06, 0.02, 120, 60);
    let texts = [1, 2, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        serde_json::to_string(&pool.install(|| measure(&result, &truth))).unwrap()
    });
    assert_eq!(texts[0], texts[1]);
    assert_eq!(texts[0], texts[2]);
}

#[test]
fn the_json_has_every_key_that_scripts_rely_on() {
    let mesh = sphere(0.05, 2);
    let json = serde_json::to_value(measure(&mesh, &mesh)).unwrap();
    for key in [
        "closed",
        "two_manifold",
        "oriented",
        "self_intersecting_faces",
        "genus",
        "components",
        "crms_mean",
        "crms_rms",
        "correspondences",
        "accuracy_mean",
        "accuracy_rms",
        "accuracy_90",
        "completeness_mean",
        "completeness_rms",
        "completeness_90",
        "chamfer",
        "hausdorff",
        "f_1mm",
        "normal_consistency",
        "min_angle_p1",
        "within_1_sigma",
        "within_2_sigma",
        "raw_accuracy_mean",
        "raw_completeness_90",
        "raw_f_half_percent",
        "raw_normal_consistency",
    ] {
        assert!(json.get(key).is_some(), "{key} is missing in {json}");
    }
    assert!(json["accuracy_rms"].as_f64().unwrap() < 1e-9);
}

#[test]
fn what_cannot_be_measured_is_refused_with_a_reason() {
    let good = sphere(0.05, 1);
    let mut not_finite = good.clone();
    not_finite.vertices[3].y = f64::NAN;
    let mut out_of_range = good.clone();
    out_of_range.triangles[1] = [0, 1, 99];
    for (mesh, says) in [
        (Mesh::default(), "no triangle"),
        (not_finite, "vertex 3 of the result"),
        (out_of_range, "[0, 1, 99]"),
    ] {
        let error =
            assess(&mesh, &good, &AssessParams::default(), &Progress::silent()).unwrap_err();
        assert!(error.to_string().contains(says), "{error}");
    }
    let progress = Progress::silent();
    progress.cancel();
    assert!(matches!(
        assess(&good, &good, &AssessParams::default(), &progress),
        Err(Error::Cancelled)
    ));
}
