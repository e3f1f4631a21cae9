//! Whether a scan lies on the map's surface or forms a second layer beside it.
//!
//! Surfaces that do not belong together touch here and there; elsewhere one of them runs a little
//! above the other and faces the same way. A single object hardly has two such layers: opposite
//! sides of a wall face opposite ways, and the two levels of a step lie side by side.

use crate::geometry::{Pose, Vec3, transform};
use crate::register::align::{Map, MapPoint};
use crate::register::registration_scan::RegistrationScan;

/// Points of the scan that are evaluated, at most: the share is then known to one per cent.
const MAX_POINTS: usize = 300;
/// Layers are searched up to this many times the distance within which a point lies on the surface:
/// farther off there may be other parts of the object.
const MAX_DISTANCE_RATIO: f64 = 4.0;
/// A layer's points lie within this many distances between the map's points, measured along the
/// surface.
const LATERAL_REACH_RATIO: f64 = 1.5;
/// Cosine of the largest angle (46 degrees) between the normals of layers that face the same way.
const MIN_NORMAL_COS: f64 = 0.7;
/// Of the points with a surface near them, at most this share may have it out of reach: noise and
/// the steps of an object make fewer.
const MAX_SECOND_LAYER_RATIO: f64 = 0.04;

/// The share of the points of `scan` at `pose` that lie above or beneath a layer of the map, out of
/// `reach` (metres), if that is more than scans of one surface show; otherwise `None`.
pub(crate) fn second_layer_ratio(
    scan: &RegistrationScan,
    map: &Map,
    pose: &Pose,
    reach: f64,
) -> Option<f64> {
    let search = LayerSearch { map, reach, step: LATERAL_REACH_RATIO * scan.map_spacing };
    let stride = scan.points.len().div_ceil(MAX_POINTS).max(1);
    let heights: Vec<f64> = (0..scan.points.len())
        .step_by(stride)
        .filter_map(|i| {
            search.height(&transform(pose, &scan.points[i]), &(pose.rotation * scan.normals[i]))
        })
        .collect();
    let out_of_reach = heights.iter().filter(|height| **height > reach).count();
    let ratio = out_of_reach as f64 / heights.len().max(1) as f64;
    (ratio > MAX_SECOND_LAYER_RATIO).then_some(ratio)
}

/// Searches the map for a layer above or beneath a point.
struct LayerSearch<'a> {
    map: &'a Map,
    /// Distance within which a point lies on the surface, metres.
    reach: f64,
    /// Distance between the places along the normal that are searched, metres.
    step: f64,
}

impl LayerSearch<'_> {
    /// Distance of `point` from the nearest layer that faces as its `normal` does, metres. Searches
    /// outwards step by step, because the other side of a thin wall may be nearer than the side
    /// that faces the same way.
    fn height(&self, point: &Vec3, normal: &Vec3) -> Option<f64> {
        let max_height = MAX_DISTANCE_RATIO * self.reach;
        self.map.nearest_within(point, max_height + self.step)?;
        let heights =
            (0..).map(|k| f64::from(k) * self.step).take_while(|height| *height < max_height);
        let layer = heights
            .flat_map(|height| [height, -height])
            .find_map(|height| self.layer_at(point, normal, height))?;
        Some((layer.point - point).dot(normal).abs())
    }

    /// A point of the map at this height above `point`, if it faces as `normal` does.
    fn layer_at(&self, point: &Vec3, normal: &Vec3, height: f64) -> Option<MapPoint> {
        let radius = if height == 0.0 { self.reach } else { self.step };
        self.map
            .nearest_within(&(point + normal * height), radius)
            .filter(|found| found.normal.dot(normal) > MIN_NORMAL_COS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Scan;
    use crate::register::params::RegisterParams;
    use crate::register::strategy::Strategy;
    use crate::scan::{PoseSigma, PreparedScan};

    /// A sheet 0.5 m away, bent by `bend` (1 / metres), and its other side 2 mm behind.
    fn simulate_sheet(bend: f32) -> RegistrationScan {
        let points = (0..80 * 80)
            .map(|i| {
                let (x, y) = ((i % 80) as f32 * 1e-3 - 0.04, (i / 80) as f32 * 1e-3 - 0.04);
                [x, y, 0.5 + bend * x * x + 5e-5 * ((i * 7919) % 13) as f32]
            })
            .collect();
        let scan = Scan { points, width: 80, origins: Vec::new() };
        let exact = PoseSigma { translation: 0.0, rotation: 0.0 };
        let strategy = Strategy::new(&RegisterParams::default());
        RegistrationScan::new(&PreparedScan::new(&scan).unwrap(), exact, &strategy)
    }

    #[test]
    fn a_surface_bent_otherwise_makes_a_second_layer_and_the_back_of_a_wall_does_not() {
        let (flat, bent) = (simulate_sheet(0.0), simulate_sheet(3.0));
        let here = Pose::identity();
        // The same sheet seen from behind, 2 mm farther on.
        let behind = Pose::from_parts(
            nalgebra::Translation3::new(0.0, 0.0, 1.002),
            nalgebra::UnitQuaternion::from_euler_angles(std::f64::consts::PI, 0.0, 0.0),
        );
        let both = [(&flat, &here), (&flat, &behind)];
        let map = RegistrationScan::map_of(both.into_iter(), flat.map_spacing);
        let reach = 1e-3;
        assert_eq!(second_layer_ratio(&flat, &map, &here, reach), None);
        let share = second_layer_ratio(&bent, &map, &here, reach).unwrap();
        // Beyond 18 mm to either side it lies more than 1 mm off, beyond 37 mm more than 4 mm.
        assert!((0.3..0.6).contains(&share), "{share}");
    }

    #[test]
    fn a_layer_counts_from_out_of_reach_up_to_four_times_the_reach() {
        let flat = simulate_sheet(0.0);
        let here = Pose::identity();
        let map = RegistrationScan::map_of(std::iter::once((&flat, &here)), flat.map_spacing);
        for (height, expected) in
            [(0.5e-3, None), (2e-3, Some(1.0)), (-3e-3, Some(1.0)), (9e-3, None)]
        {
            let found = second_layer_ratio(&flat, &map, &Pose::translation(0.0, 0.0, height), 1e-3);
            assert_eq!(found, expected, "{height}");
        }
    }

    #[test]
    fn the_height_is_that_of_the_side_that_faces_the_same_way() {
        // A wall 2 mm thick: the side that faces the point's way is farther than the other one.
        let sides: Vec<Vec3> = (0..41 * 41)
            .flat_map(|i| {
                let (x, y) = (f64::from(i % 41) * 1e-3 - 0.02, f64::from(i / 41) * 1e-3 - 0.02);
                [Vec3::new(x, y, 0.0), Vec3::new(x, y, -2e-3)]
            })
            .collect();
        let normals: Vec<Vec3> =
            sides.iter().map(|p| if p.z == 0.0 { Vec3::z() } else { -Vec3::z() }).collect();
        let mut map = Map::new(5e-4);
        let surface =
            crate::register::align::MapSurface { points: &sides, normals: &normals, boundary: &[] };
        map.insert(&surface, &Pose::identity());
        let search = LayerSearch { map: &map, reach: 1e-3, step: 1.5e-3 };
        let point = Vec3::new(2e-4, 1e-4, -2.5e-3);
        let height = search.height(&point, &Vec3::z()).unwrap();
        assert!((height - 2.5e-3).abs() < 1e-9, "{height}");
        assert!((search.height(&point, &-Vec3::z()).unwrap() - 0.5e-3).abs() < 1e-9);
        assert_eq!(search.height(&point, &Vec3::x()), None);
    }
}
