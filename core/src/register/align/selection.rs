//! Stage 1: which points of a scan are aligned (Rusinkiewicz & Levoy 2001, §3.1).

use crate::geometry::Vec3;
use crate::register::params::Selection;
use crate::register::strategy::Strategy;
use crate::scan::PreparedScan;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

/// Coarse to fine begins with one point in as many, and doubles them in each iteration.
const COARSEST_DIVISOR: usize = 16;
/// Divisions of each axis of a face of the cube of directions: 96 bins, each about 20 degrees wide.
const FACE_DIVISIONS: f64 = 4.0;

/// Indices of the points of `scan` that are aligned.
pub(crate) fn select_points(scan: &PreparedScan, strategy: &Strategy) -> Vec<usize> {
    let count = strategy.params.samples;
    let mut rng = ChaCha8Rng::seed_from_u64(strategy.params.seed as u64);
    match strategy.selection {
        Selection::All => (0..scan.points.len()).collect(),
        Selection::Random => {
            let mut drawn: Vec<usize> = (0..scan.points.len()).collect();
            drawn.shuffle(&mut rng);
            drawn.truncate(count);
            drawn.sort_unstable();
            drawn
        }
        Selection::Uniform => scan.sample(count),
        Selection::NormalSpace => spread_normals(&scan.normals, count, &mut rng),
        Selection::CoarseToFine => {
            // Any beginning of the shuffled list is spread over the scan.
            let mut uniform = scan.sample(count);
            uniform.shuffle(&mut rng);
            uniform
        }
    }
}

/// How many of `count` selected points iteration `iteration` (from 0) takes.
pub(crate) fn points_taken(selection: Selection, count: usize, iteration: usize) -> usize {
    let takes_all = iteration >= COARSEST_DIVISOR.ilog2() as usize;
    if selection != Selection::CoarseToFine || takes_all {
        return count;
    }
    (count << iteration).div_ceil(COARSEST_DIVISOR)
}

/// Takes one point after another from each bin of normals in turn until there are `count`; indices,
/// ascending.
fn spread_normals(normals: &[Vec3], count: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let mut bins: BTreeMap<[u8; 3], Vec<usize>> = BTreeMap::new();
    for (i, normal) in normals.iter().enumerate() {
        bins.entry(direction_bin(normal)).or_default().push(i);
    }
    for members in bins.values_mut() {
        members.shuffle(rng);
    }
    let mut chosen = Vec::with_capacity(count.min(normals.len()));
    while chosen.len() < count && !bins.is_empty() {
        let room = count - chosen.len();
        chosen.extend(bins.values_mut().filter_map(Vec::pop).take(room));
        bins.retain(|_, members| !members.is_empty());
    }
    chosen.sort_unstable();
    chosen
}

/// The side of the cube that a unit vector leaves through, and the division of that side.
fn direction_bin(normal: &Vec3) -> [u8; 3] {
    let axis = normal.iamax();
    let side = 2 * axis as u8 + u8::from(normal[axis] > 0.0);
    [side, face_division(normal, axis, 1), face_division(normal, axis, 2)]
}

/// The division of a side of the cube along the `k`-th axis after that of the side.
fn face_division(normal: &Vec3, axis: usize, k: usize) -> u8 {
    let along = normal[(axis + k) % 3] / normal[axis].abs().max(f64::MIN_POSITIVE);
    ((along + 1.0) / 2.0 * FACE_DIVISIONS).clamp(0.0, FACE_DIVISIONS - 1.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::register::RegisterParams;

    /// A plate of 60 x 60 points with a wall of 60 points at its end.
    fn step() -> PreparedScan {
        let mut points: Vec<Vec3> =
            (0..3600).map(|i| Vec3::new(f64::from(i % 60), f64::from(i / 60), 0.0)).collect();
        let mut normals = vec![Vec3::z(); 3600];
        points.extend((0..60).map(|i| Vec3::new(60.0, f64::from(i), 1.0)));
        normals.extend([-Vec3::x(); 60]);
        let rays = normals.iter().map(|n| -n).collect();
        PreparedScan { points, normals, rays, spacing: 1.0, noise: 0.01, ..PreparedScan::default() }
    }

    fn chosen(selection: Selection) -> Vec<usize> {
        let params = RegisterParams { selection, samples: 400, ..RegisterParams::default() };
        select_points(&step(), &Strategy::new(&params))
    }

    #[test]
    fn each_selection_takes_about_as_many_as_asked_and_all_takes_all() {
        assert_eq!(chosen(Selection::All), (0..3660).collect::<Vec<_>>());
        for selection in [Selection::Random, Selection::NormalSpace] {
            let found = chosen(selection);
            assert_eq!(found.len(), 400);
            assert!(found.is_sorted());
            assert_eq!(found, chosen(selection), "the seed does not decide");
        }
        let mut coarse = chosen(Selection::CoarseToFine);
        assert!(!coarse.is_sorted());
        coarse.sort_unstable();
        let mut uniform = chosen(Selection::Uniform);
        uniform.sort_unstable();
        assert_eq!(coarse, uniform);
    }

    #[test]
    fn normal_space_takes_the_whole_wall_and_random_little_of_it() {
        assert_eq!(chosen_of_wall(Selection::NormalSpace), 60);
        assert!(chosen_of_wall(Selection::Random) < 20);
    }

    fn chosen_of_wall(selection: Selection) -> usize {
        chosen(selection).iter().filter(|&&i| i >= 3600).count()
    }

    #[test]
    fn coarse_to_fine_ends_with_all_points() {
        let counts: Vec<usize> =
            (0..6).map(|k| points_taken(Selection::CoarseToFine, 160, k)).collect();
        assert_eq!(counts, [10, 20, 40, 80, 160, 160]);
        assert_eq!(points_taken(Selection::Uniform, 160, 0), 160);
    }
}
