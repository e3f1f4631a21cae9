//! Points sorted into voxels, for searches within a fixed radius (a cell list).

use super::{Voxel, voxel_of};
use crate::geometry::Vec3;
use rustc_hash::FxHashMap;

/// Points grouped by the voxel that holds them.
///
/// It is faster than a k-d tree where the radius of the searches is known beforehand and is about
/// the voxel's edge.
pub struct CellIndex {
    edge: f64,
    /// Indices of the points, cell by cell in ascending order.
    order: Vec<u32>,
    /// Start and end of each cell in `order`.
    ranges: FxHashMap<Voxel, (u32, u32)>,
    /// The cells that hold points, ascending.
    cells: Vec<Voxel>,
}

impl CellIndex {
    /// Sorts `points` (finite) into cells of edge `edge` (metres).
    pub fn new(points: &[Vec3], edge: f64) -> CellIndex {
        let keys: Vec<Voxel> = points.iter().map(|p| voxel_of(p, edge)).collect();
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        order.sort_unstable_by_key(|&i| (keys[i as usize], i));
        let mut ranges = FxHashMap::default();
        let mut cells = Vec::new();
        let mut start = 0;
        for chunk in order.chunk_by(|&a, &b| keys[a as usize] == keys[b as usize]) {
            let end = start + chunk.len() as u32;
            ranges.insert(keys[chunk[0] as usize], (start, end));
            cells.push(keys[chunk[0] as usize]);
            start = end;
        }
        CellIndex { edge, order, ranges, cells }
    }

    /// The cells that hold points, ascending.
    pub fn cells(&self) -> &[Voxel] {
        &self.cells
    }

    /// Indices of the points in `cell`, ascending.
    pub fn points_in(&self, cell: Voxel) -> &[u32] {
        self.ranges
            .get(&cell)
            .map_or(&[], |&(start, end)| &self.order[start as usize..end as usize])
    }

    /// Calls `visit(index, squared distance)` for each point within `radius` (metres) of `query`,
    /// in an order that depends on the points alone. `points` are those given to
    /// [`CellIndex::new`].
    pub fn for_each_within(
        &self,
        points: &[Vec3],
        query: &Vec3,
        radius: f64,
        mut visit: impl FnMut(usize, f64),
    ) {
        let low = voxel_of(&query.add_scalar(-radius), self.edge);
        let high = voxel_of(&query.add_scalar(radius), self.edge);
        let square = radius * radius;
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    for &i in self.points_in([x, y, z]) {
                        let distance = (points[i as usize] - query).norm_squared();
                        if distance <= square {
                            visit(i as usize, distance);
                        }
                    }
                }
            }
        }
    }
}

/// Of `members` (indices into `points`), the one nearest to their mean; `None` without members.
pub fn nearest_to_mean(points: &[Vec3], members: &[u32]) -> Option<usize> {
    let mean = members.iter().map(|&i| points[i as usize]).sum::<Vec3>() / members.len() as f64;
    let nearest = members.iter().copied().min_by(|&a, &b| {
        let [a, b] = [a, b].map(|i| (points[i as usize] - mean).norm_squared());
        a.total_cmp(&b)
    });
    nearest.map(|i| i as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_what_brute_force_finds() {
        let points: Vec<Vec3> = (0..500)
            .map(|i| {
                let i = f64::from(i);
                Vec3::new((i * 12.9).sin(), (i * 7.3).sin(), (i * 3.1).cos())
            })
            .collect();
        let index = CellIndex::new(&points, 0.2);
        for query in points.iter().step_by(17) {
            let mut found = Vec::new();
            index.for_each_within(&points, query, 0.35, |i, _| found.push(i));
            found.sort_unstable();
            let expected: Vec<usize> =
                (0..points.len()).filter(|&i| (points[i] - query).norm() <= 0.35).collect();
            assert_eq!(found, expected);
        }
        assert_eq!(index.cells().iter().map(|c| index.points_in(*c).len()).sum::<usize>(), 500);
    }

    #[test]
    fn cells_list_their_points_ascending_and_squared_distances_are_given() {
        let points = [[0.9, 0.0, 0.0], [-0.1, 0.0, 0.0], [0.1, 0.2, 0.3], [0.5, 0.5, 0.5]];
        let points = points.map(Vec3::from);
        let index = CellIndex::new(&points, 1.0);
        assert_eq!(index.cells(), [[-1, 0, 0], [0, 0, 0]]);
        assert_eq!(index.points_in([0, 0, 0]), [0, 2, 3]);
        assert!(index.points_in([5, 5, 5]).is_empty());
        let mut found = Vec::new();
        index.for_each_within(&points, &Vec3::zeros(), 0.5, |i, squared| found.push((i, squared)));
        assert_eq!(found.len(), 2);
        assert!(found.iter().all(|(i, squared)| *squared == points[*i].norm_squared()));
    }

    #[test]
    fn the_member_nearest_to_the_mean_is_chosen_of_the_members_alone() {
        let points: Vec<Vec3> = (0..10).map(|i| Vec3::x() * f64::from(i * i)).collect();
        // The mean of 0, 1, 4, 81 is 21.5.
        assert_eq!(nearest_to_mean(&points, &[0, 1, 2, 9]), Some(2));
        assert_eq!(nearest_to_mean(&points, &[7]), Some(7));
        assert_eq!(nearest_to_mean(&points, &[]), None);
    }
}
