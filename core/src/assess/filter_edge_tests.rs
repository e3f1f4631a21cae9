//! The effect of the filter on walls and edges, and what the thesis observed about its radii.

use crate::Progress;
use crate::filter::{FilterMethod, FilterParams, Filtered, filter};
use crate::geometry::{KdTree, Pose, Vec3};
use crate::mesh::test_shapes::cuboid;
use crate::scan::PreparedScan;
use crate::simulate::{NoiseFamily, SimulateParams, simulate};

/// The box from the origin to `corner` (metres), seen from 26 sides.
fn scanned(corner: Vec3, family: NoiseFamily, params: &[FilterParams]) -> Vec<Filtered> {
    let simulation = SimulateParams { family, ..SimulateParams::default() };
    let scans =
        simulate(&cuboid(Vec3::zeros(), corner), &simulation, 1, &Progress::silent()).unwrap();
    let prepared: Vec<PreparedScan> =
        scans.views.iter().map(|v| PreparedScan::new(&v.scan).unwrap()).collect();
    let posed: Vec<(&PreparedScan, Pose)> =
        prepared.iter().zip(&scans.views).map(|(p, v)| (p, v.true_pose)).collect();
    params.iter().map(|p| filter(&posed, None, p, &Progress::silent()).unwrap()).collect()
}

fn by_itself(corner: Vec3, family: NoiseFamily) -> Filtered {
    scanned(corner, family, &[FilterParams::default()]).remove(0)
}

#[test]
fn both_sides_of_a_wall_of_2_mm_stay_apart() {
    for (family, most) in [(NoiseFamily::P1, 0.3e-3), (NoiseFamily::P3, 1e-3)] {
        let cloud = by_itself(Vec3::new(0.06, 0.06, 0.002), family).cloud;
        let (mut merged, mut sides) = (0, [0, 0]);
        for (p, n) in cloud.points.iter().zip(&cloud.normals) {
            let inside = (p.xy().add_scalar(-0.03)).abs().max() < 0.025;
            if inside && n.z.abs() > 0.7 {
                let expected = if n.z > 0.0 { 0.002 } else { 0.0 };
                merged += usize::from((p.z - expected).abs() > most);
                sides[usize::from(n.z > 0.0)] += 1;
            }
        }
        assert!(sides.iter().all(|s| *s > 100), "{family:?}: {sides:?}");
        // A wrong merger would lie 1 mm off, stereo's own error is half of that.
        assert!(merged * 20 < sides[0] + sides[1], "{family:?}: {merged} of {sides:?}");
    }
}

#[test]
fn an_edge_loses_less_than_half_the_noise_radius() {
    let corner = Vec3::new(0.06, 0.06, 0.06);
    for family in [NoiseFamily::P1, NoiseFamily::P3] {
        let found = by_itself(corner, family);
        let radius = found.noise_radius;
        // How far the points of the upper face reach towards an edge, in strips as wide as the
        // noise radius.
        let strips = (0.05 / radius) as usize;
        let mut lost = 0.0;
        for strip in 0..strips {
            let low = 0.005 + strip as f64 * radius;
            let on_face = found
                .cloud
                .points
                .iter()
                .zip(&found.cloud.normals)
                .filter(|(p, n)| n.z > 0.7 && p.z > 0.03 && p.y >= low && p.y < low + radius);
            lost += (0.06 - on_face.map(|(p, _)| p.x).fold(0.0, f64::max)).max(0.0);
        }
        let mean = lost / strips as f64;
        assert!(strips >= 5 && mean < 0.5 * radius, "{family:?}: {mean} of {radius}");
    }
}

fn thesis(noise_radius: f64, reduction_radius: f64) -> FilterParams {
    FilterParams {
        method: FilterMethod::Thesis,
        noise_radius,
        reduction_radius,
        ..FilterParams::default()
    }
}

const SIDE: f64 = 0.04;

/// Root mean square distance to the box of points within 2 mm of an edge, metres.
fn error_at_edges(found: &Filtered) -> f64 {
    let half = SIDE / 2.0;
    let errors = found.cloud.points.iter().filter_map(|p| {
        let mut off: Vec<f64> = p.iter().map(|c| (c - half).abs() - half).collect();
        off.sort_unstable_by(f64::total_cmp);
        // The outermost coordinate is the distance to the face, the one before that to the edge.
        (off[1] > -2e-3 && off[2] < 2e-3).then_some(off[2] * off[2])
    });
    let (sum, count) = errors.fold((0.0, 0.0), |(sum, count), e| (sum + e, count + 1.0));
    f64::sqrt(sum / count)
}

/// Share of the upper face farther than 2 mm from every point.
fn holes(found: &Filtered) -> f64 {
    let tree = KdTree::new(&found.cloud.points);
    let places: Vec<Vec3> = (0..40 * 40)
        .map(|i| Vec3::new(f64::from(i % 40) * 1e-3, f64::from(i / 40) * 1e-3, SIDE))
        .collect();
    let far = places.iter().filter(|p| tree.nearest_within(p, 2e-3).is_none()).count();
    far as f64 / places.len() as f64
}

#[test]
fn the_thesis_filter_blurs_edges_by_a_large_noise_radius_and_leaves_holes_by_a_large_reduction_radius()
 {
    let params = [thesis(1e-3, 0.5e-3), thesis(8e-3, 0.5e-3), thesis(1e-3, 6e-3)];
    let found = scanned(Vec3::new(SIDE, SIDE, SIDE), NoiseFamily::P1, &params);
    let (fine, blurred) = (error_at_edges(&found[0]), error_at_edges(&found[1]));
    assert!(blurred > 1.5 * fine, "{fine} {blurred}");
    let (dense, sparse) = (holes(&found[0]), holes(&found[2]));
    assert!(dense < 0.01 && sparse > 0.2, "{dense} {sparse}");
}
