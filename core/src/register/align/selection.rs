//! Stage 1: which points of a scan are aligned (Rusinkiewicz & Levoy 2001, §3.1).

use crate::geometry::Vec3;
use crate::register::{PreparedScan, RegisterParams};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

crate::choice! {
    /// Which points of a scan are aligned.
    pub enum Selection {
        /// Every point (Besl & McKay 1992).
        All = "all",
        /// Points drawn at random (Masuda, Sakaue & Yokoya 1996).
        Random = "random",
        /// One point a cell of a grid (Turk & Levoy 1994).
        Uniform = "uniform",
        /// Points whose normals are spread as evenly as they can be (Rusinkiewicz & Levoy 2001), so that the few that hold
        /// a sliding direction count.
        NormalSpace = "normal_space",
        /// As uniform, a sixteenth at first and twice as many in each iteration (Turk & Levoy 1994, Zhang 1994).
        CoarseToFine = "coarse_to_fine",
    }
}

/// The share of the points that coarse to fine begins with.
const COARSEST: usize = 16;

/// Indices of the points of `scan` that are aligned.
pub(crate) fn select(scan: &PreparedScan, params: &RegisterParams) -> Vec<usize> {
    let mut rng = ChaCha8Rng::seed_from_u64(params.seed as u64);
    let all = || (0..scan.points.len()).collect::<Vec<usize>>();
    match params.stages().selection {
        Selection::All => all(),
        Selection::Random => {
            let mut drawn = all();
            drawn.shuffle(&mut rng);
            drawn.truncate(params.samples);
            drawn.sort_unstable();
            drawn
        }
        Selection::Uniform => scan.sample(params.samples),
        Selection::NormalSpace => spread_normals(&scan.normals, params.samples, &mut rng),
        Selection::CoarseToFine => {
            // Any beginning of the list is spread over the scan.
            let mut uniform = scan.sample(params.samples);
            uniform.shuffle(&mut rng);
            uniform
        }
    }
}

/// How many of `count` selected points iteration `iteration` (from 0) takes.
pub(crate) fn taken(selection: Selection, count: usize, iteration: usize) -> usize {
    if selection != Selection::CoarseToFine || iteration >= COARSEST.ilog2() as usize {
        return count;
    }
    (count << iteration).div_ceil(COARSEST)
}

/// Divisions of each axis of a face of the cube of directions: 96 bins, each about 20 degrees wide.
const DIVISIONS: f64 = 4.0;

/// Takes one point after another from each bin of normals in turn until there are `count`; indices, ascending.
fn spread_normals(normals: &[Vec3], count: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let mut bins: BTreeMap<[u8; 3], Vec<usize>> = BTreeMap::new();
    for (i, normal) in normals.iter().enumerate() {
        bins.entry(bin(normal)).or_default().push(i);
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

/// Side of the cube that a unit vector leaves through, and where.
fn bin(normal: &Vec3) -> [u8; 3] {
    let axis = normal.iamax();
    let place = |k: usize| {
        let along = normal[(axis + k) % 3] / normal[axis].abs().max(f64::MIN_POSITIVE);
        ((along + 1.0) / 2.0 * DIVISIONS).clamp(0.0, DIVISIONS - 1.0) as u8
    };
    [2 * axis as u8 + u8::from(normal[axis] > 0.0), place(1), place(2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plate of 60 x 60 points with a wall of 60 points at its end.
    fn step() -> PreparedScan {
        let grid = |i: usize| Vec3::new((i % 60) as f64, (i / 60) as f64, 0.0);
        let mut points: Vec<Vec3> = (0..3600).map(grid).collect();
        let mut normals = vec![Vec3::z(); 3600];
        points.extend((0..60).map(|i| Vec3::new(60.0, f64::from(i), 1.0)));
        normals.extend([-Vec3::x(); 60]);
        let rays = normals.iter().map(|n| -n).collect();
        PreparedScan { points, normals, rays, spacing: 1.0, noise: 0.01, ..PreparedScan::default() }
    }

    fn chosen(selection: Selection) -> Vec<usize> {
        select(&step(), &RegisterParams { selection, samples: 400, ..RegisterParams::default() })
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
        let wall = |selection| chosen(selection).iter().filter(|&&i| i >= 3600).count();
        assert_eq!(wall(Selection::NormalSpace), 60);
        assert!(wall(Selection::Random) < 20);
    }

    #[test]
    fn coarse_to_fine_ends_with_all_points() {
        let counts: Vec<usize> = (0..6).map(|k| taken(Selection::CoarseToFine, 160, k)).collect();
        assert_eq!(counts, [10, 20, 40, 80, 160, 160]);
        assert_eq!(taken(Selection::Uniform, 160, 0), 160);
    }
}
