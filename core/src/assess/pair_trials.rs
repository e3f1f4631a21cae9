//! Trials that show how far verdicts on pairs of scans can be trusted.
//!
//! A trial takes two simulated scans, perturbs their true relative pose (a rotation about the
//! centroid of the moving scan's hits, then a translation) and aligns the scans again. Registration
//! is told the covariance of the distribution from which the perturbation was drawn, as by a user
//! who states errors of "up to 5 degrees and 8 mm".

use super::perturbation::perturb_pose;
use super::pose_errors::{PosedHits, pair_error};
use crate::Result;
use crate::geometry::{KdTree, Mat6, Pose, Twist, Vec3, adjoint, log, transform};
use crate::register::{PairScan, RegisterParams, Verdict, align_pair_with_covariance};
use crate::scan::{PoseSigma, PreparedScan};
use crate::simulate::{SimulatedScans, SimulatedView};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// The situation that a trial tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrialKind {
    /// Perturbed by 1 to 5 degrees and 1 to 8 mm, with at least 40 % overlap: should be accepted.
    Near,
    /// Perturbed by 5 to 20 degrees and 8 to 30 mm, with at least 40 % overlap: must not be
    /// accepted with a wrong pose.
    Far,
    /// Perturbed as `Near`, but with at most 5 % overlap: must not be accepted.
    Apart,
    /// Perturbed as `Near`, but the moving scan is of another object: must not be accepted.
    Alien,
}

impl TrialKind {
    /// Whether scans with this overlap can be used for such a trial.
    fn suits_overlap(self, overlap: f64) -> bool {
        match self {
            TrialKind::Apart => overlap <= MAX_APART_OVERLAP_RATIO,
            _ => overlap >= MIN_OVERLAP_RATIO,
        }
    }

    /// The sizes from which the perturbation is drawn.
    fn perturbation(self) -> PerturbationRange {
        let (degrees, distances) = match self {
            TrialKind::Far => ([5.0_f64, 20.0], [0.008, 0.03]),
            _ => ([1.0, 5.0], [0.001, 0.008]),
        };
        PerturbationRange { angles: degrees.map(f64::to_radians), distances }
    }
}

/// Smallest and largest size of a perturbation.
struct PerturbationRange {
    /// Radians.
    angles: [f64; 2],
    /// Metres.
    distances: [f64; 2],
}

impl PerturbationRange {
    /// Covariance of a pose (order x y z rx ry rz, sensor frame) whose error is a rotation about
    /// `center` and a translation of sizes uniform in these ranges and of random directions.
    fn covariance(&self, center: &Vec3) -> Mat6 {
        let rotation = axis_variance(self.angles);
        let translation = axis_variance(self.distances);
        let diagonal =
            Twist::new(translation, translation, translation, rotation, rotation, rotation);
        let about_center = Mat6::from_diagonal(&diagonal);
        let sensor_from_center = adjoint(&Pose::translation(center.x, center.y, center.z));
        sensor_from_center * about_center * sensor_from_center.transpose()
    }
}

/// Variance along an axis of vectors of random direction whose length is uniform in [a, b]: a third
/// of the mean square (a^2 + a b + b^2) / 3.
fn axis_variance([a, b]: [f64; 2]) -> f64 {
    (a * a + a * b + b * b) / 9.0
}

/// A simulated scan that is prepared for trials.
pub struct TrialScan {
    pair: PairScan,
    hits: PosedHits,
    /// Centroid of the hits, sensor frame, metres.
    center: Vec3,
    /// Unit normals of the surface at the hits, sensor frame.
    normals: Vec<Vec3>,
    /// Index of the hits, sensor frame.
    tree: KdTree,
    /// Distance below which hits of two scans are the same place, metres.
    match_radius: f64,
}

/// The outcome of a trial.
#[derive(Clone, Debug)]
pub struct PairTrial {
    /// The situation that was tested.
    pub kind: TrialKind,
    /// Indices of the moving scan and of the one that it was aligned to.
    pub views: (usize, usize),
    /// Share of the moving scan's true hits that the fixed scan saw too.
    pub overlap: f64,
    /// Root mean square distance of the hits from their true places under the perturbed pose, mm.
    pub error_before: f64,
    /// The same after the alignment, mm.
    pub error_after: f64,
    /// Normalised estimation error squared (NEES): squared Mahalanobis distance of the pose's error
    /// by the verdict's covariance; `None` if that is singular.
    pub nees: Option<f64>,
    /// The verdict on the alignment.
    pub verdict: Verdict,
}

/// Overlap from which a pair of scans should be registered.
const MIN_OVERLAP_RATIO: f64 = 0.4;
/// Overlap up to which no method can register a pair.
const MAX_APART_OVERLAP_RATIO: f64 = 0.05;
/// A pose with a larger error of the hits is wrong, unless its covariance explains the error.
const MAX_POSE_ERROR_MM: f64 = 5.0;
/// The covariance explains an error of up to this many standard deviations.
const MAX_ERROR_SIGMAS: f64 = 5.0;
/// Hits are the same place if they are nearer than this many spacings of the hits.
const MATCH_RADIUS_SPACINGS: f64 = 1.5;
/// Limit of the hits of a scan with which overlap and errors are measured.
const MAX_HITS_PER_SCAN: usize = 2000;

impl PairTrial {
    /// Whether the scan was accepted.
    pub fn is_accepted(&self) -> bool {
        self.verdict.is_accepted()
    }

    /// Whether the scan was accepted although it should not have been.
    pub fn is_false_success(&self) -> bool {
        let wrong = match self.kind {
            TrialKind::Near | TrialKind::Far => {
                self.error_after > MAX_POSE_ERROR_MM
                    && self.nees.is_some_and(|nees| nees > MAX_ERROR_SIGMAS * MAX_ERROR_SIGMAS)
            }
            TrialKind::Apart | TrialKind::Alien => true,
        };
        self.is_accepted() && wrong
    }
}

/// Prepares the scans of `simulated` for trials.
///
/// # Errors
/// As [`PreparedScan::new`].
pub fn prepare_trial_scans(
    simulated: &SimulatedScans,
    params: &RegisterParams,
) -> Result<Vec<TrialScan>> {
    let views = simulated.views.iter();
    views.map(|view| TrialScan::new(view, simulated.pose_sigma, params)).collect()
}

impl TrialScan {
    fn new(
        view: &SimulatedView,
        pose_sigma: PoseSigma,
        params: &RegisterParams,
    ) -> Result<TrialScan> {
        let prepared = PreparedScan::new(&view.scan)?;
        let all_hits: Vec<&[f32; 3]> = view.hits.iter().filter(|h| h[0].is_finite()).collect();
        let step = all_hits.len().div_ceil(MAX_HITS_PER_SCAN).max(1);
        let hits: Vec<Vec3> =
            all_hits.iter().step_by(step).map(|h| Vec3::from(h.map(f64::from))).collect();
        let measured = KdTree::new(&prepared.points);
        let normals = hits.iter().map(|hit| {
            measured.nearest(hit).map_or_else(Vec3::zeros, |(i, _)| prepared.normals[i])
        });
        Ok(TrialScan {
            normals: normals.collect(),
            pair: PairScan::new(&prepared, pose_sigma, params),
            center: hits.iter().sum::<Vec3>() / hits.len().max(1) as f64,
            tree: KdTree::new(&hits),
            // Thinning by a factor widens the spacing on the surface by its root.
            match_radius: MATCH_RADIUS_SPACINGS * prepared.spacing * (step as f64).sqrt(),
            hits: PosedHits { hits, truth: view.true_pose, estimate: view.true_pose },
        })
    }
}

/// Runs up to `count` trials with `scans` of one object; [`TrialKind::Alien`] takes the moving scan
/// from `aliens`, which are of another object.
///
/// Half of the trials are near, three tenths far, and one tenth each apart and alien. Trials for
/// which no fitting pair of scans exists are left out.
pub fn run_pair_trials(
    scans: &[TrialScan],
    aliens: &[TrialScan],
    count: usize,
    seed: u64,
    params: &RegisterParams,
) -> Vec<PairTrial> {
    use TrialKind::{Alien, Apart, Far, Near};
    const KINDS: [TrialKind; 10] = [Near, Far, Near, Apart, Near, Far, Near, Alien, Near, Far];
    let overlaps: Vec<Vec<f64>> = scans
        .par_iter()
        .map(|moving| scans.iter().map(|fixed| overlap_ratio(moving, fixed)).collect())
        .collect();
    let trials = (0..count).into_par_iter().filter_map(|number| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(number as u64);
        let kind = KINDS[number % KINDS.len()];
        let (moving, fixed) = choose_pair(kind, &overlaps, &mut rng)?;
        let moving_scan = if kind == Alien { aliens.get(moving)? } else { &scans[moving] };
        let overlap = overlaps[moving][fixed];
        Some(PairTrial {
            views: (moving, fixed),
            overlap,
            ..run_trial(kind, moving_scan, &scans[fixed], &mut rng, params).ok()?
        })
    });
    trials.collect()
}

/// Draws a moving and a fixed scan whose overlap suits the kind of trial.
fn choose_pair(
    kind: TrialKind,
    overlaps: &[Vec<f64>],
    rng: &mut ChaCha8Rng,
) -> Option<(usize, usize)> {
    let pairs: Vec<(usize, usize)> = (0..overlaps.len())
        .flat_map(|m| (0..overlaps.len()).map(move |f| (m, f)))
        .filter(|&(m, f)| m != f && kind.suits_overlap(overlaps[m][f]))
        .collect();
    (!pairs.is_empty()).then(|| pairs[rng.random_range(0..pairs.len())])
}

/// Perturbs the true relative pose and aligns `moving` to `fixed` from there. Indices of the views
/// and their overlap are left for the caller.
fn run_trial(
    kind: TrialKind,
    moving: &TrialScan,
    fixed: &TrialScan,
    rng: &mut ChaCha8Rng,
    params: &RegisterParams,
) -> Result<PairTrial> {
    let range = kind.perturbation();
    let angle = rng.random_range(range.angles[0]..range.angles[1]);
    let distance = rng.random_range(range.distances[0]..range.distances[1]);
    let truth = fixed.hits.truth.inverse() * moving.hits.truth;
    let guess = perturb_pose(&truth, &moving.center, angle, distance, rng);
    let stated = range.covariance(&moving.center);
    let (pose, verdict) =
        align_pair_with_covariance(&moving.pair, &fixed.pair, &guess, &stated, params)?;
    let error: Twist = log(&(pose.inverse() * truth));
    let inverse = verdict.covariance.try_inverse();
    Ok(PairTrial {
        kind,
        views: (0, 0),
        overlap: 0.0,
        error_before: pair_error(&moving.hits, &fixed.hits, &guess),
        error_after: pair_error(&moving.hits, &fixed.hits, &pose),
        nees: inverse.map(|inverse| error.dot(&(inverse * error))),
        verdict,
    })
}

/// Share of the hits of `moving` that `fixed` saw too, from the same side.
fn overlap_ratio(moving: &TrialScan, fixed: &TrialScan) -> f64 {
    let relative: Pose = fixed.hits.truth.inverse() * moving.hits.truth;
    let hits = &moving.hits.hits;
    let seen_by_both = hits.iter().zip(&moving.normals).filter(|(hit, normal)| {
        let found = fixed.tree.nearest_within(&transform(&relative, hit), fixed.match_radius);
        found.is_some_and(|(i, _)| (relative.rotation * *normal).dot(&fixed.normals[i]) > 0.0)
    });
    seen_by_both.count() as f64 / hits.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Progress;
    use crate::simulate::{NoiseFamily, SimulateParams, objects, simulate};

    #[test]
    fn near_pairs_are_accepted_and_others_are_no_success() {
        let params = RegisterParams::default();
        let simulation =
            SimulateParams { family: NoiseFamily::P3, views: 10, ..Default::default() };
        let [scans, aliens] = ["coffee", "mug"].map(|object| {
            let truth = objects::make_object(object).unwrap();
            let scans = simulate(&truth, &simulation, 1, &Progress::silent()).unwrap();
            prepare_trial_scans(&scans, &params).unwrap()
        });
        let trials = run_pair_trials(&scans, &aliens, 20, 1, &params);
        let mut near_trials = 0;
        for trial in &trials {
            match trial.kind {
                TrialKind::Near => {
                    near_trials += 1;
                    assert!(trial.is_accepted() && !trial.is_false_success(), "{trial:?}");
                    assert!(trial.overlap >= MIN_OVERLAP_RATIO && trial.error_before > 1.0);
                }
                TrialKind::Apart => assert!(!trial.is_accepted(), "{trial:?}"),
                TrialKind::Far | TrialKind::Alien => {}
            }
        }
        assert!(near_trials >= 9);
    }

    #[test]
    fn the_stated_covariance_is_that_of_the_perturbations() {
        let range = TrialKind::Near.perturbation();
        let center = Vec3::new(0.05, -0.02, 0.4);
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut covariance = Mat6::zeros();
        let count = 20_000;
        for _ in 0..count {
            let angle = rng.random_range(range.angles[0]..range.angles[1]);
            let distance = rng.random_range(range.distances[0]..range.distances[1]);
            let moved = perturb_pose(&Pose::identity(), &center, angle, distance, &mut rng);
            let error = log(&moved);
            covariance += error * error.transpose() / f64::from(count);
        }
        let stated = range.covariance(&center);
        for r in 0..6 {
            for c in 0..6 {
                // Scaled to correlations, which the sampling error keeps within some per cent.
                let scale = (stated[(r, r)] * stated[(c, c)]).sqrt();
                let difference = (covariance[(r, c)] - stated[(r, c)]) / scale;
                assert!(difference.abs() < 0.05, "{r} {c}: {difference}");
            }
        }
    }

    #[test]
    fn pairs_are_drawn_among_those_whose_overlap_suits() {
        let overlaps = [vec![1.0, 0.5, 0.02], vec![0.45, 1.0, 0.2], vec![0.01, 0.3, 1.0]];
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..50 {
            let near = choose_pair(TrialKind::Near, &overlaps, &mut rng).unwrap();
            assert!([(0, 1), (1, 0)].contains(&near), "{near:?}");
            let apart = choose_pair(TrialKind::Apart, &overlaps, &mut rng).unwrap();
            assert!([(0, 2), (2, 0)].contains(&apart), "{apart:?}");
        }
        assert_eq!(choose_pair(TrialKind::Far, &overlaps[2..], &mut rng), None);
    }
}
