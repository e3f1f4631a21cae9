//! How much of the measured surface a mesh lies on.
//!
//! The measure must not depend on how densely a place was measured, neither by the length at which
//! a point counts as explained nor by the weight of the place. So the length is three times the
//! spacing of the points there, the points are put into cells of about that edge, and a cell counts
//! by the area of a surface that fills it.

use crate::geometry::{Aabb, Cloud, KdTree, Surface, Vec3, median};
use crate::mesh::Mesh;
use crate::voxel::{Voxel, voxel_of};
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use std::cmp::Reverse;

/// Edge of a cell, and largest distance from the mesh at which it is explained, in spacings of the
/// points there: a few, because gaps of one or two spacings are chance, and a mesh smooths over
/// about as much.
const REACH_IN_SPACINGS: f64 = 3.0;

/// The neighbour whose distance is the spacing at a point: on an even lattice it is as far as the
/// first, and it is near enough to lie on the same side of a thin wall.
const SPACING_NEIGHBOUR: usize = 4;

/// Neighbours over which spacings are smoothed: the two rings round a point of a hexagonal lattice,
/// enough that chance and noise of single points drop out, and few enough to stay local.
const SMOOTHED_NEIGHBOURS: usize = 12;

/// Least spacing, as a share of the cloud's diagonal: single precision does not tell points apart
/// that are nearer.
const MIN_SPACING_RATIO: f64 = 1e-6;

/// Share of the cells which `cloud` occupies that lie within three local spacings of `mesh`, 0 to
/// 1.
///
/// A cell lies where the mean of its points lies, and counts by its edge squared, the area that it
/// stands for. The edge is the power of two (in metres) nearest to three spacings of the points in
/// it, and no cell lies within another one. Points of support 0 are no measurements and do not
/// count. The share is rounded to single precision, as messages hold it. `None` if nothing was
/// measured.
pub fn explained_share(cloud: &Cloud, mesh: &Mesh) -> Option<f64> {
    let measured = (0..cloud.len()).filter(|&i| cloud.support[i] > 0);
    let points: Vec<Vec3> = measured.map(|i| cloud.points[i]).collect();
    let cells = occupied_cells(&points, &local_spacings(&points));
    if cells.is_empty() {
        return None;
    }
    // A mesh without a triangle explains nothing.
    let surface = Surface::new(&mesh.vertices, &mesh.triangles).ok();
    let explained: Vec<bool> = cells
        .par_iter()
        .map(|cell| surface.as_ref().is_some_and(|surface| cell.is_explained_by(surface)))
        .collect();
    let whole: f64 = cells.iter().map(SurfaceCell::area).sum();
    let part: f64 = cells.iter().zip(&explained).filter(|(_, e)| **e).map(|(c, _)| c.area()).sum();
    Some(f64::from((part / whole) as f32))
}

/// The distance between the points round each point, metres.
///
/// A point takes the median of its neighbours' spacings and its own, so that one that lies alone
/// off a surface does not pass for a sparse surface.
fn local_spacings(points: &[Vec3]) -> Vec<f64> {
    let tree = KdTree::new(points);
    let near: Vec<Vec<(usize, f64)>> =
        points.par_iter().map(|p| tree.nearest_n(p, SMOOTHED_NEIGHBOURS + 1)).collect();
    let own: Vec<f64> = near.iter().map(|near| own_spacing(near)).collect();
    // A cloud of one place has no spacing at all: any that is positive will do.
    let least =
        (MIN_SPACING_RATIO * Aabb::from_points(points).diagonal()).max(f64::from(f32::EPSILON));
    near.par_iter()
        .map(|near| {
            let spacings = near.iter().map(|(i, _)| own[*i]).collect();
            median(spacings).unwrap_or(0.0).max(least)
        })
        .collect()
}

/// The spacing at a point with the neighbours `near`, of which the first is the point itself;
/// metres.
fn own_spacing(near: &[(usize, f64)]) -> f64 {
    near.get(SPACING_NEIGHBOUR).or(near.last()).map_or(0.0, |(_, square)| square.sqrt())
}

/// A place that points occupy.
struct SurfaceCell {
    /// Metres.
    edge: f64,
    /// Sum of the positions of its points.
    points: Vec3,
    /// Sum of the spacings of its points.
    spacings: f64,
    /// Number of its points.
    count: f64,
}

impl SurfaceCell {
    /// Area of a surface that fills the cell, square metres.
    fn area(&self) -> f64 {
        self.edge * self.edge
    }

    /// Whether the mean of its points lies near the surface of the mesh.
    fn is_explained_by(&self, surface: &Surface) -> bool {
        let distance = surface.distance(&(self.points / self.count));
        distance <= REACH_IN_SPACINGS * self.spacings / self.count
    }
}

/// The level of the cells for points of this spacing (metres): the binary logarithm of their edge.
fn cell_level(spacing: f64) -> i32 {
    (REACH_IN_SPACINGS * spacing).log2().round() as i32
}

/// The place of a point in the grid of cells of one level.
fn place_on(level: i32, point: &Vec3) -> (i32, Voxel) {
    (level, voxel_of(point, 2f64.powi(level)))
}

/// The cells that points with these spacings occupy, the largest first.
fn occupied_cells(points: &[Vec3], spacings: &[f64]) -> Vec<SurfaceCell> {
    let mut order: Vec<(Reverse<i32>, usize)> =
        spacings.iter().enumerate().map(|(i, s)| (Reverse(cell_level(*s)), i)).collect();
    order.sort_unstable();
    let mut levels: Vec<i32> = Vec::new();
    let mut cells: Vec<SurfaceCell> = Vec::new();
    let mut places: FxHashMap<(i32, Voxel), usize> = FxHashMap::default();
    for (Reverse(own), i) in order {
        if levels.last() != Some(&own) {
            levels.push(own);
        }
        // Where sparse points have a cell already, it takes the denser ones too: no place counts
        // twice.
        let taken =
            levels.iter().find_map(|level| places.get(&place_on(*level, &points[i])).copied());
        let at = taken.unwrap_or_else(|| {
            places.insert(place_on(own, &points[i]), cells.len());
            let edge = 2f64.powi(own);
            cells.push(SurfaceCell { edge, points: Vec3::zeros(), spacings: 0.0, count: 0.0 });
            cells.len() - 1
        });
        let cell = &mut cells[at];
        cell.points += points[i];
        cell.spacings += spacings[i];
        cell.count += 1.0;
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_edge_of_a_cell_is_the_power_of_two_nearest_to_three_spacings() {
        // 3 mm lies between 2^-9 = 1.95 mm and 2^-8 = 3.91 mm, nearer to the latter by ratio.
        assert_eq!(cell_level(1e-3), -8);
        assert_eq!(cell_level(1.0 / 3.0), 0);
    }

    #[test]
    fn a_dense_point_joins_the_cell_of_a_sparse_one() {
        let points = [Vec3::repeat(0.1), Vec3::repeat(0.2), Vec3::repeat(5.1)];
        let cells = occupied_cells(&points, &[1.0 / 3.0, 0.1 / 3.0, 0.1 / 3.0]);
        let found: Vec<(f64, f64)> = cells.iter().map(|c| (c.edge, c.count)).collect();
        assert_eq!(found, [(1.0, 2.0), (0.125, 1.0)]);
        assert!((cells[0].points - Vec3::repeat(0.3)).norm() < 1e-12);
    }

    #[test]
    fn a_lone_point_takes_the_spacing_of_its_neighbours() {
        let mut points: Vec<Vec3> =
            (0..400).map(|i| Vec3::new(f64::from(i % 20), f64::from(i / 20), 0.0) * 1e-3).collect();
        points.push(Vec3::new(0.01, 0.01, 0.05));
        let spacings = local_spacings(&points);
        assert!((spacings[210] - 1e-3).abs() < 1e-12, "{}", spacings[210]);
        assert!((spacings[400] - 1e-3).abs() < 1e-12, "{}", spacings[400]);
    }
}
