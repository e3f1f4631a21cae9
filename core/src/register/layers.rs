//! Whether a scan lies on the map's surface or makes a second layer beside it.
//!
//! Surfaces that do not belong together touch here and there; elsewhere one runs a little above the other and faces the same
//! way. Of one object there are hardly two such layers: opposite sides of a wall face opposite ways, and steps lie beside each
//! other.

use super::align::{Map, Target};
use super::sample::Sample;
use crate::geometry::Pose;

/// Points that are looked at.
const POINTS: usize = 300;
/// Layers are looked for up to so many times the distance within which a point lies on the surface: farther off there may
/// be other parts of the object.
const FAR: f64 = 4.0;
/// Along the surface, a layer's points lie within so many distances between the map's points.
const BESIDE: f64 = 1.5;
/// Cosine between normals of layers that face the same way.
const ALIKE: f64 = 0.7;
/// Of the points with a surface near them, this share may have it out of reach: noise and the steps of an object make fewer.
const MOST: f64 = 0.04;

/// The share of the points of `sample` at `pose` that lie above or beneath a layer of the map, out of `reach` (metres), if
/// that is more than scans of one surface make.
pub(crate) fn doubled(sample: &Sample, map: &Map, pose: &Pose, reach: f64) -> Option<f64> {
    let step = BESIDE * sample.target_spacing;
    let stride = sample.points.len().div_ceil(POINTS).max(1);
    let height = |i: usize| -> Option<f64> {
        let point = pose.rotation * sample.points[i] + pose.translation.vector;
        let normal = pose.rotation * sample.normals[i];
        let faces_alike = |t: &Target| t.normal.dot(&normal) > ALIKE;
        map.nearest_within(&point, FAR * reach + step)?;
        // Outwards, because the other side of a thin wall may be nearer than the side that faces alike.
        let heights = (0..).map(|k| f64::from(k) * step).take_while(|h| *h < FAR * reach);
        let layer = |h: f64| {
            let within = if h == 0.0 { reach } else { step };
            map.nearest_within(&(point + normal * h), within).filter(faces_alike)
        };
        let found = heights.flat_map(|h| [h, -h]).find_map(layer)?;
        Some((found.point - point).dot(&normal).abs())
    };
    let heights: Vec<f64> = (0..sample.points.len()).step_by(stride).filter_map(height).collect();
    let out = heights.iter().filter(|h| **h > reach).count();
    let share = out as f64 / heights.len().max(1) as f64;
    (share > MOST).then_some(share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Scan;
    use crate::register::{PoseSigma, PreparedScan, RegisterParams};

    /// A sheet 0.5 m away, bent by `bend` (1 / metres), and its other side 2 mm behind.
    fn sample(bend: f32) -> Sample {
        let points = (0..80 * 80)
            .map(|i| {
                let (x, y) = ((i % 80) as f32 * 1e-3 - 0.04, (i / 80) as f32 * 1e-3 - 0.04);
                [x, y, 0.5 + bend * x * x + 5e-5 * ((i * 7919) % 13) as f32]
            })
            .collect();
        let scan = Scan { points, width: 80, origins: Vec::new() };
        let exact = PoseSigma { translation: 0.0, rotation: 0.0 };
        Sample::new(&PreparedScan::new(&scan).unwrap(), exact, &RegisterParams::default())
    }

    #[test]
    fn a_surface_bent_otherwise_makes_a_second_layer_and_the_back_of_a_wall_does_not() {
        let (flat, bent) = (sample(0.0), sample(3.0));
        let here = Pose::identity();
        // The same sheet seen from behind, 2 mm farther on.
        let behind = Pose::from_parts(
            nalgebra::Translation3::new(0.0, 0.0, 1.002),
            nalgebra::UnitQuaternion::from_euler_angles(std::f64::consts::PI, 0.0, 0.0),
        );
        let both = [(&flat, &here), (&flat, &behind)];
        let map = Sample::map_of(both.into_iter(), flat.target_spacing);
        let reach = 1e-3;
        assert_eq!(doubled(&flat, &map, &here, reach), None);
        let share = doubled(&bent, &map, &here, reach).unwrap();
        // Beyond 18 mm to either side it lies more than 1 mm off, beyond 37 mm more than 4 mm.
        assert!((0.3..0.6).contains(&share), "{share}");
    }
}
