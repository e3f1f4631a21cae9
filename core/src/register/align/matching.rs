//! Stage 2: which point of the map each point of the scan should lie on (Rusinkiewicz & Levoy 2001, §3.2).

use super::map::{Map, Target};
use super::{Moving, halfway};
use crate::geometry::{KdTree, Pose, Vec3};
use crate::register::RegisterParams;
use rayon::prelude::*;

crate::choice! {
    /// Which point of the map a point of the scan should lie on.
    pub enum Matching {
        /// The closest (Besl & McKay 1992).
        Closest = "closest",
        /// The closest, if of the scan's points this one is the closest to it (Pajdla & Van Gool 1995).
        Mutual = "mutual",
        /// Where the point's ray meets the map: the tangent planes of closest points are met in turn (Chen & Medioni
        /// 1992, §3.2, there along the normal).
        Projective = "projective",
    }
}

/// A point of the scan and the point of the map that it should lie on.
pub(crate) struct Correspondence {
    /// Which of the scan's points.
    pub index: usize,
    /// The scan's point, sensor frame.
    pub point: Vec3,
    pub target: Vec3,
    /// Unit normals of the scan's point and of the target, object frame.
    pub here: Vec3,
    pub there: Vec3,
    /// Normal of the plane halfway between the two points' tangent planes, object frame.
    pub normal: Vec3,
    /// Signed distance along `normal`, and the distance between the points, metres.
    pub distance: f64,
    pub gap: f64,
    /// Whether the target lies at the border of what the scans saw.
    pub boundary: bool,
}

impl Correspondence {
    /// Cosine of the angle between the normals.
    pub(crate) fn agreement(&self) -> f64 {
        self.here.dot(&self.there)
    }
}

/// Planes that a ray is intersected with at most: each step leaves of the distance to a smooth surface its square.
const PLANES: usize = 3;
/// A ray nearer to its plane than this (cosine of 80 degrees from the normal) meets it anywhere.
const GRAZING: f64 = 0.17;

/// Finds correspondences of the points of one scan.
pub(crate) struct Matcher<'a> {
    moving: Moving<'a>,
    map: &'a Map,
    matching: Matching,
    /// Over the scan's points, where they have to be found back.
    back: Option<KdTree>,
    /// Where each point was last, and how far from the map, metres.
    last: Vec<(Vec3, f64)>,
}

impl<'a> Matcher<'a> {
    pub(crate) fn new(moving: Moving<'a>, map: &'a Map, params: &RegisterParams) -> Matcher<'a> {
        let matching = params.stages().matching;
        let back = (matching == Matching::Mutual).then(|| KdTree::new(moving.points));
        // Nothing is known yet: anything may be near.
        let last = vec![(Vec3::zeros(), f64::NEG_INFINITY); moving.points.len()];
        Matcher { moving, map, matching, back, last }
    }

    /// Pairs of the scan's points at `pose` and the map's within `reach` (metres), in the order of the points.
    pub(crate) fn find(&mut self, pose: &Pose, reach: f64) -> Vec<Correspondence> {
        let mut last = std::mem::take(&mut self.last);
        let at = |(i, last): (usize, &mut (Vec3, f64))| self.pair(i, last, pose, reach);
        let found = last.par_iter_mut().enumerate().filter_map(at).collect();
        self.last = last;
        found
    }

    fn pair(
        &self,
        index: usize,
        last: &mut (Vec3, f64),
        pose: &Pose,
        reach: f64,
    ) -> Option<Correspondence> {
        let point = self.moving.points[index];
        let moved = pose.rotation * point + pose.translation.vector;
        let found = match self.matching {
            Matching::Closest => self.closest(last, &moved, reach)?,
            Matching::Mutual => self.mutual(index, &moved, pose, reach)?,
            Matching::Projective => {
                self.along_ray(&moved, &(pose.rotation * self.moving.rays[index]), reach)?
            }
        };
        let (here, there) = (pose.rotation * self.moving.normals[index], found.normal);
        let agreement = there.dot(&here);
        // Planes that face away from each other have none halfway.
        let normal = if agreement > 0.0 { halfway(&there, &here, agreement) } else { there };
        let between = moved - found.point;
        Some(Correspondence {
            index,
            point,
            target: found.point,
            here,
            there,
            normal,
            distance: normal.dot(&between),
            gap: between.norm(),
            boundary: found.boundary,
        })
    }

    /// A point came no nearer to the map than it moved: most of those that are far off need no search, which would take
    /// longest for them.
    fn closest(&self, last: &mut (Vec3, f64), moved: &Vec3, reach: f64) -> Option<Target> {
        if last.1 - (moved - last.0).norm() > reach {
            return None;
        }
        let (target, distance) = self.map.nearest(moved)?;
        *last = (*moved, distance);
        (distance <= reach).then_some(target)
    }

    fn mutual(&self, index: usize, moved: &Vec3, pose: &Pose, reach: f64) -> Option<Target> {
        let found = self.map.nearest_within(moved, reach)?;
        let seen = pose.inverse_transform_point(&found.point.into()).coords;
        let (back, _) = self.back.as_ref()?.nearest(&seen)?;
        (back == index).then_some(found)
    }

    /// Where the line through `moved` along the unit vector `ray` meets the map.
    fn along_ray(&self, moved: &Vec3, ray: &Vec3, reach: f64) -> Option<Target> {
        let mut found = self.map.nearest_within(moved, reach)?;
        for step in 1.. {
            let slope = found.normal.dot(ray);
            if slope.abs() < GRAZING {
                return None;
            }
            let met = moved + ray * (found.normal.dot(&(found.point - moved)) / slope);
            if (met - moved).norm_squared() > reach * reach {
                return None;
            }
            // On the surface no point is farther from the map than its voxels and the noise have it.
            let near = 2.0 * self.map.voxel() + 3.0 * self.moving.noise;
            let next = self.map.nearest_within(&met, if step < PLANES { reach } else { near })?;
            if step == PLANES {
                return Some(Target { point: met, ..found });
            }
            found = next;
        }
        None
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::super::map::Surface;
    use super::*;

    /// The point `index` of a scan that lies at (0, 0, 1) in the sensor frame, `gap` above its target.
    pub(crate) fn pair(index: usize, gap: f64) -> Correspondence {
        Correspondence {
            index,
            point: Vec3::z(),
            target: Vec3::z() * (1.0 - gap),
            here: Vec3::z(),
            there: Vec3::z(),
            normal: Vec3::z(),
            distance: gap,
            gap,
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
        let surface = Surface { points: &points, normals: &normals, boundary: &[] };
        map.insert(&surface, &Pose::identity());
        map
    }

    fn found(matching: Matching, points: &[Vec3]) -> Vec<Correspondence> {
        let normals = vec![Vec3::z(); points.len()];
        let rays = vec![Vec3::new(0.6, 0.0, -0.8); points.len()];
        let moving = Moving { points, normals: &normals, rays: &rays, noise: 0.01 };
        let params = RegisterParams { matching, ..RegisterParams::default() };
        Matcher::new(moving, &plate(), &params).find(&Pose::identity(), 10.0)
    }

    #[test]
    fn a_ray_meets_the_plate_where_geometry_says() {
        let found = found(Matching::Projective, &[Vec3::new(1.3, 0.2, 4.0)]);
        assert!((found[0].target - Vec3::new(4.3, 0.2, 0.0)).norm() < 1e-12, "{}", found[0].target);
        assert!((found[0].gap - 5.0).abs() < 1e-12);
        assert!((found[0].distance - 4.0).abs() < 1e-12);
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
        assert_eq!(mutual.iter().map(|c| c.index).collect::<Vec<_>>(), [1]);
        assert_eq!(found(Matching::Closest, &points).len(), 2);
    }

    #[test]
    fn what_was_far_off_is_found_again_when_it_has_come_near() {
        let points: Vec<Vec3> =
            (0..60).map(|i| Vec3::new(f64::from(i % 7), 0.0, f64::from(i) / 3.0)).collect();
        let normals = vec![Vec3::z(); points.len()];
        let moving = Moving { points: &points, normals: &normals, rays: &normals, noise: 0.01 };
        let (map, params) = (plate(), RegisterParams::default());
        let mut matcher = Matcher::new(moving, &map, &params);
        for (height, reach) in [(5.0, 6.0), (4.0, 5.0), (-9.0, 3.0), (-8.5, 4.0), (0.0, 2.0)] {
            let pose = Pose::translation(0.3, 0.0, height);
            let indices = |matcher: &mut Matcher| -> Vec<usize> {
                matcher.find(&pose, reach).iter().map(|c| c.index).collect()
            };
            let anew = indices(&mut Matcher::new(moving, &map, &params));
            assert!(!anew.is_empty());
            assert_eq!(indices(&mut matcher), anew);
        }
    }
}
