//! Stage 2: which point of the map each point of the scan should lie on (Rusinkiewicz & Levoy 2001,
//! §3.2).

use super::map::{Map, MapPoint};
use super::source::Source;
use crate::geometry::{KdTree, MIN_INCIDENCE_COS, Pose, Vec3, transform};
use crate::register::params::Matching;
use rayon::prelude::*;

/// Planes that a ray is intersected with at most: each step leaves of the distance to a smooth
/// surface its square.
const MAX_PLANES: usize = 3;
/// No point of the surface lies farther from the map's nearest than this many voxels...
const MAX_SURFACE_VOXELS: f64 = 2.0;
/// ...and standard deviations of the noise.
const MAX_SURFACE_SIGMAS: f64 = 3.0;

/// A point of the scan and the point of the map that it should lie on.
pub(crate) struct Correspondence {
    /// Which of the scan's points.
    pub index: usize,
    /// The scan's point, sensor frame, metres.
    pub point: Vec3,
    /// The point of the map, object frame, metres.
    pub target: Vec3,
    /// Unit normal of the scan's point, object frame.
    pub source_normal: Vec3,
    /// Unit normal of the target, object frame.
    pub target_normal: Vec3,
    /// Normal of the plane halfway between the two points' tangent planes, object frame.
    pub normal: Vec3,
    /// Signed distance of the scan's point from the target along `normal`, metres.
    pub plane_distance: f64,
    /// Distance between the points, metres.
    pub point_distance: f64,
    /// Whether the target lies at the border of what the scans saw.
    pub boundary: bool,
}

impl Correspondence {
    /// Cosine of the angle between the normals.
    pub(crate) fn normal_cos(&self) -> f64 {
        self.source_normal.dot(&self.target_normal)
    }
}

/// Finds correspondences of the points of one scan.
pub(crate) struct Matcher<'a> {
    source: Source<'a>,
    map: &'a Map,
    matching: Matching,
    /// Over the scan's points, for [`Matching::Mutual`].
    source_tree: Option<KdTree>,
    /// The last search of each point.
    searches: Vec<LastSearch>,
}

/// Where a point was when its nearest point of the map was searched last.
struct LastSearch {
    /// Position of the point, object frame, metres.
    position: Vec3,
    /// Its distance from the map, metres; minus infinity before the first search.
    distance: f64,
}

impl Default for LastSearch {
    /// Before the first search, the point may be anywhere.
    fn default() -> LastSearch {
        LastSearch { position: Vec3::zeros(), distance: f64::NEG_INFINITY }
    }
}

impl<'a> Matcher<'a> {
    pub(crate) fn new(source: Source<'a>, map: &'a Map, matching: Matching) -> Matcher<'a> {
        let source_tree = (matching == Matching::Mutual).then(|| KdTree::new(source.points));
        let searches = source.points.iter().map(|_| LastSearch::default()).collect();
        Matcher { source, map, matching, source_tree, searches }
    }

    /// Pairs of the scan's points at `pose` and the map's within `reach` (metres), in the order of
    /// the points.
    pub(crate) fn find(&mut self, pose: &Pose, reach: f64) -> Vec<Correspondence> {
        let mut searches = std::mem::take(&mut self.searches);
        let pairs = searches
            .par_iter_mut()
            .enumerate()
            .filter_map(|(i, search)| self.match_point(i, search, pose, reach))
            .collect();
        self.searches = searches;
        pairs
    }

    fn match_point(
        &self,
        index: usize,
        search: &mut LastSearch,
        pose: &Pose,
        reach: f64,
    ) -> Option<Correspondence> {
        let point = self.source.points[index];
        let moved = transform(pose, &point);
        let target = match self.matching {
            Matching::Closest => self.closest(search, &moved, reach)?,
            Matching::Mutual => self.mutually_closest(index, &moved, pose, reach)?,
            Matching::Projective => {
                self.along_ray(&moved, &(pose.rotation * self.source.rays[index]), reach)?
            }
        };
        let (here, there) = (pose.rotation * self.source.normals[index], target.normal);
        let agreement = there.dot(&here);
        // Planes that face away from each other have none halfway.
        let normal =
            if agreement > 0.0 { symmetric_normal(&there, &here, agreement) } else { there };
        let between = moved - target.point;
        Some(Correspondence {
            index,
            point,
            target: target.point,
            source_normal: here,
            target_normal: there,
            normal,
            plane_distance: normal.dot(&between),
            point_distance: between.norm(),
            boundary: target.boundary,
        })
    }

    /// The closest point of the map. Since its last search, a point came no nearer to the map than
    /// it has moved: most of the distant ones need no search, which would take longest for them.
    fn closest(&self, search: &mut LastSearch, moved: &Vec3, reach: f64) -> Option<MapPoint> {
        if search.distance - (moved - search.position).norm() > reach {
            return None;
        }
        let (target, distance) = self.map.nearest(moved)?;
        *search = LastSearch { position: *moved, distance };
        (distance <= reach).then_some(target)
    }

    /// The closest point of the map, if point `index` is the closest of the scan's to it.
    fn mutually_closest(
        &self,
        index: usize,
        moved: &Vec3,
        pose: &Pose,
        reach: f64,
    ) -> Option<MapPoint> {
        let target = self.map.nearest_within(moved, reach)?;
        let seen = pose.inverse_transform_point(&target.point.into()).coords;
        let (back, _) = self.source_tree.as_ref()?.nearest(&seen)?;
        (back == index).then_some(target)
    }

    /// Where the line through `moved` along the unit vector `ray` meets the map.
    fn along_ray(&self, moved: &Vec3, ray: &Vec3, reach: f64) -> Option<MapPoint> {
        let mut target = self.map.nearest_within(moved, reach)?;
        for step in 1.. {
            let slope = target.normal.dot(ray);
            if slope.abs() < MIN_INCIDENCE_COS {
                return None;
            }
            let hit = moved + ray * (target.normal.dot(&(target.point - moved)) / slope);
            if (hit - moved).norm_squared() > reach * reach {
                return None;
            }
            let at_surface =
                MAX_SURFACE_VOXELS * self.map.voxel() + MAX_SURFACE_SIGMAS * self.source.noise;
            let radius = if step < MAX_PLANES { reach } else { at_surface };
            let next = self.map.nearest_within(&hit, radius)?;
            if step == MAX_PLANES {
                return Some(MapPoint { point: hit, ..target });
            }
            target = next;
        }
        None
    }
}

/// The normal for which the curvature of the surface between two points cancels, so that the
/// distance is right to third order (Rusinkiewicz 2019, A Symmetric Objective Function for ICP);
/// `agreement` is `a . b`.
fn symmetric_normal(a: &Vec3, b: &Vec3, agreement: f64) -> Vec3 {
    (a + b) / (1.0 + agreement)
}
