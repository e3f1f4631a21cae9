//! The lengths that the reconstruction works with.

use super::params::ReconstructParams;
use crate::geometry::{Aabb, Cloud, KdTree, median};

/// The lengths that the reconstruction works with, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scale {
    /// Distance between the filtered points.
    pub points: f64,
    /// Edge of a voxel.
    pub voxel: f64,
    /// Distance between the corners of the field's lattice.
    pub lattice: f64,
    /// Edge of the finished mesh.
    pub edge: f64,
    /// Edge at the start of detailing.
    pub start_edge: f64,
}

/// Edge length in distances between the points: with shorter edges the mesh would follow the noise
/// of single points.
const EDGE_PER_SPACING: f64 = 1.6;
/// Least voxel edge in distances between the points: in smaller ones the surface would have holes.
const MIN_VOXEL_PER_SPACING: f64 = 1.2;
/// Width of the search for points round a vertex, in edge lengths.
const SEARCH_PER_EDGE: f64 = 0.5;

/// Distance between the lattice's corners as a share of the narrowest wall or slot that the points
/// resolve: one corner must fall between its sides.
const LATTICE_PER_GAP: f64 = 0.8;
/// That wall is one distance between the points thick, less this many standard deviations: noise
/// moves both sides.
const MIN_GAP_SIGMAS: f64 = 3.0;
/// Least distance between the lattice's corners in distances between the points, however noisy they
/// are.
const MIN_LATTICE_PER_SPACING: f64 = 0.4;

/// Largest number of lattice corners, unless the spacing of the lattice is given. Beyond it thin
/// walls are not worth the time (some seconds), and the lattice is coarser, up to the edge length
/// of the mesh.
const MAX_AUTOMATIC_CORNERS: f64 = 3e7;

/// Points whose spacing is measured, about.
const SPACING_PROBES: usize = 2000;
/// The neighbour whose distance is the spacing at a point, counted with the point itself: on a
/// square or hexagonal lattice it is as far as the nearest one, and one or two lost points do not
/// matter.
const SPACING_NEIGHBOUR: usize = 5;
/// Spacing of a cloud without points, metres.
const DEFAULT_SPACING_M: f64 = 1e-3;

impl Scale {
    /// The lengths that `params` give, else those that follow from the cloud.
    pub(super) fn new(cloud: &Cloud, params: &ReconstructParams) -> Scale {
        let points = spacing(cloud);
        let edge = given_or(params.edge_length, EDGE_PER_SPACING * points);
        let voxel = given_or(params.voxel_edge, edge.max(MIN_VOXEL_PER_SPACING * points));
        let sigma = median(cloud.sigma.iter().copied().filter(|s| s.is_finite()).collect());
        let gap = points - MIN_GAP_SIGMAS * sigma.unwrap_or(0.0);
        let finest = MIN_LATTICE_PER_SPACING * points;
        let volume = Aabb::from_points(&cloud.points).extent().iter().product::<f64>();
        let affordable = (volume / MAX_AUTOMATIC_CORNERS).cbrt();
        let wanted = (LATTICE_PER_GAP * gap).max(finest).max(affordable);
        let lattice = given_or(params.voxel_edge, wanted.min(edge));
        Scale { points, voxel, lattice, edge, start_edge: (params.start_edge * voxel).max(edge) }
    }

    /// Width of the search for points round a vertex while edges have length `edge` (metres).
    pub(super) fn search_width(&self, edge: f64) -> f64 {
        self.points.max(SEARCH_PER_EDGE * edge)
    }
}

/// `value`, or `automatic` if it is 0.
fn given_or(value: f64, automatic: f64) -> f64 {
    if value > 0.0 { value } else { automatic }
}

/// Median distance of the points to their neighbours, metres.
fn spacing(cloud: &Cloud) -> f64 {
    let tree = KdTree::new(&cloud.points);
    let stride = cloud.len().div_ceil(SPACING_PROBES).max(1);
    let distances = cloud.points.iter().step_by(stride).filter_map(|p| {
        tree.nearest_n(p, SPACING_NEIGHBOUR).last().map(|(_, square)| square.sqrt())
    });
    median(distances.collect()).unwrap_or(DEFAULT_SPACING_M)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vec3;

    /// A square sheet of 30 x 30 points, 2 mm apart.
    fn sheet() -> Cloud {
        let mut cloud = Cloud::default();
        for i in 0..900 {
            let point = Vec3::new(f64::from(i % 30), f64::from(i / 30), 0.0) * 2e-3;
            cloud.push(point, Vec3::z(), 1e-4, 3);
        }
        cloud
    }

    #[test]
    fn lengths_follow_from_the_spacing_of_the_points() {
        let scale = Scale::new(&sheet(), &ReconstructParams::default());
        assert!((scale.points - 2e-3).abs() < 1e-12, "{scale:?}");
        assert!((scale.edge - 3.2e-3).abs() < 1e-12, "{scale:?}");
        assert!((scale.voxel - 3.2e-3).abs() < 1e-12, "{scale:?}");
        // 0.8 (2 mm - 3 * 0.1 mm).
        assert!((scale.lattice - 1.36e-3).abs() < 1e-12, "{scale:?}");
        assert!((scale.search_width(scale.edge) - 2e-3).abs() < 1e-12);
        assert!((scale.search_width(0.01) - 5e-3).abs() < 1e-12);
    }

    #[test]
    fn lengths_that_are_given_are_kept() {
        let params = ReconstructParams {
            edge_length: 0.005,
            voxel_edge: 0.004,
            start_edge: 2.0,
            ..ReconstructParams::default()
        };
        let scale = Scale::new(&sheet(), &params);
        assert_eq!((scale.edge, scale.voxel, scale.lattice), (0.005, 0.004, 0.004));
        assert_eq!(scale.start_edge, 0.008);
    }
}
