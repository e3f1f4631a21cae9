use super::map::{Map, MapSurface};
use super::matching::{Correspondence, Matcher};
use super::source::Source;
use crate::geometry::{Pose, Vec3};
use crate::register::params::Matching;

/// The point `index` of a scan that lies at (0, 0, 1) in the sensor frame, `gap` above its
/// target.
pub(crate) fn pair(index: usize, gap: f64) -> Correspondence {
    Correspondence {
        index,
        point: Vec3::z(),
        target: Vec3::z() * (1.0 - gap),
        source_normal: Vec3::z(),
        target_normal: Vec3::z(),
        normal: Vec3::z(),
        plane_distance: gap,
        point_distance: gap,
        boundary: false,
    }
}

/// A plate at z = 0 of 41 x 41 points, 1 m apart about the origin.
fn plate() -> Map {
    let points: Vec<Vec3> = (0..41 * 41)
        .map(|i| Vec3::new(f64::from(i % 41 - 20), f64::from(i / 41 - 20), 0.0))
        .collect();
    let normals = vec![Vec3::z(); points.len()];
    let mut map = Map::new(1.0);
    let surface = MapSurface { points: &points, normals: &normals, boundary: &[] };
    map.insert(&surface, &Pose::identity());
    map
}

fn found(matching: Matching, points: &[Vec3]) -> Vec<Correspondence> {
    let normals = vec![Vec3::z(); points.len()];
    let rays = vec![Vec3::new(0.6, 0.0, -0.8); points.len()];
    let source = Source { points, normals: &normals, rays: &rays, noise: 0.01 };
    Matcher::new(source, &plate(), matching).find(&Pose::identity(), 10.0)
}

#[test]
fn a_ray_meets_the_plate_where_geometry_says() {
    let found = found(Matching::Projective, &[Vec3::new(1.3, 0.2, 4.0)]);
    assert!((found[0].target - Vec3::new(4.3, 0.2, 0.0)).norm() < 1e-12, "{}", found[0].target);
    assert!((found[0].point_distance - 5.0).abs() < 1e-12);
    assert!((found[0].plane_distance - 4.0).abs() < 1e-12);
}

#[test]
fn a_ray_that_leaves_the_plate_meets_nothing() {
    assert!(found(Matching::Projective, &[Vec3::new(18.0, 0.0, 7.0)]).is_empty());
    assert_eq!(found(Matching::Closest, &[Vec3::new(18.0, 0.0, 7.0)]).len(), 1);
}

#[test]
fn of_two_points_above_one_target_the_nearer_is_mutually_closest() {
    let points = [Vec3::new(0.1, 0.0, 3.0), Vec3::new(0.1, 0.0, 2.0)];
    let mutual = found(Matching::Mutual, &points);
    assert_eq!(indices(&mutual), [1]);
    assert_eq!(found(Matching::Closest, &points).len(), 2);
}

#[test]
fn what_was_far_off_is_found_again_when_it_has_come_near() {
    let points: Vec<Vec3> =
        (0..60).map(|i| Vec3::new(f64::from(i % 7), 0.0, f64::from(i) / 3.0)).collect();
    let normals = vec![Vec3::z(); points.len()];
    let source = Source { points: &points, normals: &normals, rays: &normals, noise: 0.01 };
    let map = plate();
    let mut matcher = Matcher::new(source, &map, Matching::Closest);
    for (height, reach) in [(5.0, 6.0), (4.0, 5.0), (-9.0, 3.0), (-8.5, 4.0), (0.0, 2.0)] {
        let pose = Pose::translation(0.3, 0.0, height);
        let anew = indices(&Matcher::new(source, &map, Matching::Closest).find(&pose, reach));
        assert!(!anew.is_empty());
        assert_eq!(indices(&matcher.find(&pose, reach)), anew);
    }
}

fn indices(pairs: &[Correspondence]) -> Vec<usize> {
    pairs.iter().map(|c| c.index).collect()
}
