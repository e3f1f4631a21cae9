//! How far verdicts on pairs of scans can be believed: scans of known poses are moved off and aligned again.
//!
//! A trial takes two simulated scans, moves one off the true relative pose (turned about its points' middle, then
//! shifted), and states to the registration the standard deviation that goes with the range of sizes from which
//! the error was drawn. A user who says "up to 5 degrees and 8 mm" states the same.

use super::align::apply;
use super::perturb::perturbed;
use super::poses::{PosedHits, pair_error};
use crate::Result;
use crate::geometry::{KdTree, Mat6, Pose, Twist, Vec3, adjoint, log};
use crate::register::{PairScan, PreparedScan, RegisterParams, Status, Verdict, align_pair_within};
use crate::simulate::SimulatedScans;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// What a trial asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrialKind {
    /// 1 to 5 degrees and 1 to 8 mm off, at least 40 % overlap: to be accepted.
    Near,
    /// 5 to 20 degrees and 8 to 30 mm off, at least 40 % overlap: never to be accepted with a wrong pose.
    Far,
    /// As near, but at most 5 % overlap: never to be accepted.
    Apart,
    /// As near, but the scan that moves is of another object: never to be accepted.
    Alien,
}

impl TrialKind {
    /// Smallest and largest angle (radians) and distance (metres) of the error.
    fn ranges(self) -> ([f64; 2], [f64; 2]) {
        let (degrees, metres) = match self {
            TrialKind::Far => ([5.0_f64, 20.0], [0.008, 0.03]),
            _ => ([1.0, 5.0], [0.001, 0.008]),
        };
        (degrees.map(f64::to_radians), metres)
    }
}

/// A scan with which trials are made.
pub struct TrialScan {
    pair: PairScan,
    hits: PosedHits,
    /// The middle of the hits, sensor frame.
    center: Vec3,
    /// Normals of the surface at the hits, sensor frame.
    normals: Vec<Vec3>,
    /// Over the hits, sensor frame.
    tree: KdTree,
    /// Hits this near are the same place, metres.
    near: f64,
}

/// The outcome of a trial.
#[derive(Clone, Debug)]
pub struct Trial {
    /// What was asked.
    pub kind: TrialKind,
    /// Numbers of the scan that moved and of the one it was aligned to.
    pub views: (usize, usize),
    /// Share of the moving scan's true hits that the other scan saw too.
    pub overlap: f64,
    /// Root mean square distance that the hits are off, mm: before and after.
    pub error: (f64, f64),
    /// Squared Mahalanobis distance of the pose's error by the verdict's covariance.
    pub nees: f64,
    /// The verdict.
    pub verdict: Verdict,
}

/// Overlap from which a pair should come together, and up to which none can tell.
const ENOUGH: f64 = 0.4;
const TOO_LITTLE: f64 = 0.05;
/// A pose that puts the hits farther off is wrong, mm, unless the covariance explains it to this many deviations.
const WRONG: f64 = 5.0;
const EXPLAINED: f64 = 5.0;
/// Hits of a scan that overlaps and errors are measured with.
const HITS: usize = 2000;

impl Trial {
    /// Whether the scan was accepted.
    pub fn accepted(&self) -> bool {
        self.verdict.status == Status::Accepted
    }

    /// Whether it was accepted although it should not have been.
    pub fn false_success(&self) -> bool {
        let wrong = match self.kind {
            TrialKind::Near | TrialKind::Far => {
                self.error.1 > WRONG && self.nees > EXPLAINED * EXPLAINED
            }
            TrialKind::Apart | TrialKind::Alien => true,
        };
        self.accepted() && wrong
    }
}

/// Makes the scans of `simulated` ready for trials.
///
/// # Errors
/// As [`PreparedScan::new`].
pub fn trial_scans(simulated: &SimulatedScans, params: &RegisterParams) -> Result<Vec<TrialScan>> {
    let one = |view: &crate::simulate::SimulatedView| {
        let prepared = PreparedScan::new(&view.scan)?;
        let met: Vec<&[f32; 3]> = view.hits.iter().filter(|h| h[0].is_finite()).collect();
        let step = met.len().div_ceil(HITS).max(1);
        let hits: Vec<Vec3> =
            met.iter().step_by(step).map(|h| Vec3::from(h.map(f64::from))).collect();
        let measured = KdTree::new(&prepared.points);
        let normal = |hit: &Vec3| {
            measured.nearest(hit).map_or_else(Vec3::zeros, |(i, _)| prepared.normals[i])
        };
        Ok(TrialScan {
            normals: hits.iter().map(normal).collect(),
            pair: PairScan::new(&prepared, simulated.pose_sigma, params),
            center: hits.iter().sum::<Vec3>() / hits.len().max(1) as f64,
            tree: KdTree::new(&hits),
            near: 1.5 * prepared.spacing * (step as f64).sqrt(),
            hits: PosedHits { hits, truth: view.true_pose, estimate: view.true_pose },
        })
    };
    simulated.views.iter().map(one).collect()
}

/// Makes `count` trials with the scans of one object, and of another one for [`TrialKind::Alien`].
///
/// Half of the trials are near, three tenths far, and one tenth each apart and alien.
pub fn trials(
    scans: &[TrialScan],
    aliens: &[TrialScan],
    count: usize,
    seed: u64,
    params: &RegisterParams,
) -> Vec<Trial> {
    use TrialKind::{Alien, Apart, Far, Near};
    const KINDS: [TrialKind; 10] = [Near, Far, Near, Apart, Near, Far, Near, Alien, Near, Far];
    let overlaps: Vec<Vec<f64>> = scans
        .par_iter()
        .map(|moving| scans.iter().map(|fixed| overlap(moving, fixed)).collect())
        .collect();
    let one = |number: usize| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(number as u64);
        let kind = KINDS[number % KINDS.len()];
        let (moving, fixed) = choose(kind, &overlaps, &mut rng)?;
        let of = if kind == Alien { aliens.get(moving)? } else { &scans[moving] };
        let overlap = overlaps[moving][fixed];
        Some(Trial {
            views: (moving, fixed),
            overlap,
            ..attempt(kind, of, &scans[fixed], &mut rng, params).ok()?
        })
    };
    (0..count).into_par_iter().filter_map(one).collect()
}

/// Two scans fit for the question: moving and fixed.
fn choose(kind: TrialKind, overlaps: &[Vec<f64>], rng: &mut ChaCha8Rng) -> Option<(usize, usize)> {
    let fits = |overlap: f64| match kind {
        TrialKind::Apart => overlap <= TOO_LITTLE,
        _ => overlap >= ENOUGH,
    };
    let pairs: Vec<(usize, usize)> = (0..overlaps.len())
        .flat_map(|m| (0..overlaps.len()).map(move |f| (m, f)))
        .filter(|&(m, f)| m != f && fits(overlaps[m][f]))
        .collect();
    (!pairs.is_empty()).then(|| pairs[rng.random_range(0..pairs.len())])
}

fn attempt(
    kind: TrialKind,
    moving: &TrialScan,
    fixed: &TrialScan,
    rng: &mut ChaCha8Rng,
    params: &RegisterParams,
) -> Result<Trial> {
    let (angles, distances) = kind.ranges();
    let angle = rng.random_range(angles[0]..angles[1]);
    let distance = rng.random_range(distances[0]..distances[1]);
    let truth = fixed.hits.truth.inverse() * moving.hits.truth;
    let guess = perturbed(&truth, &moving.center, angle, distance, rng);
    let stated = stated(angles, distances, &moving.center);
    let (pose, verdict) = align_pair_within(&moving.pair, &fixed.pair, &guess, &stated, params)?;
    let error: Twist = log(&(pose.inverse() * truth));
    let inverse = verdict.covariance.try_inverse();
    Ok(Trial {
        kind,
        views: (0, 0),
        overlap: 0.0,
        error: (
            pair_error(&moving.hits, &fixed.hits, &guess),
            pair_error(&moving.hits, &fixed.hits, &pose),
        ),
        nees: inverse.map_or(f64::NAN, |inverse| error.dot(&(inverse * error))),
        verdict,
    })
}

/// The covariance that a user states of a guess that is off by sizes uniform in these ranges: mean squares, spread over
/// three axes, of a turn about `center` and a shift.
fn stated(angles: [f64; 2], distances: [f64; 2], center: &Vec3) -> Mat6 {
    let per_axis = |[a, b]: [f64; 2]| (a * a + a * b + b * b) / 9.0;
    let (turn, shift) = (per_axis(angles), per_axis(distances));
    let of_center =
        Mat6::from_fn(|r, c| if r == c { if r < 3 { shift } else { turn } } else { 0.0 });
    let sensor_from_center = adjoint(&Pose::translation(center.x, center.y, center.z));
    sensor_from_center * of_center * sensor_from_center.transpose()
}

/// Share of the hits of `moving` that `fixed` saw too, from the same side.
fn overlap(moving: &TrialScan, fixed: &TrialScan) -> f64 {
    let relative: Pose = fixed.hits.truth.inverse() * moving.hits.truth;
    let seen = |(hit, normal): &(&Vec3, &Vec3)| {
        let found = fixed.tree.nearest_within(&apply(&relative, hit), fixed.near);
        found.is_some_and(|(i, _)| (relative.rotation * *normal).dot(&fixed.normals[i]) > 0.0)
    };
    let hits = &moving.hits.hits;
    hits.iter().zip(&moving.normals).filter(seen).count() as f64 / hits.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Progress;
    use crate::simulate::{NoiseFamily, SimulateParams, objects, simulate};

    #[test]
    fn near_pairs_are_accepted_and_others_are_no_success() {
        let params = RegisterParams::default();
        let of = SimulateParams { family: NoiseFamily::P3, views: 10, ..Default::default() };
        let scans = |object: &str| {
            let truth = objects::make(object).unwrap();
            let scans = simulate(&truth, &of, 1, &Progress::silent()).unwrap();
            trial_scans(&scans, &params).unwrap()
        };
        let made = trials(&scans("coffee"), &scans("mug"), 20, 1, &params);
        let of_kind = |kind: TrialKind| made.iter().filter(move |t| t.kind == kind);
        assert!(of_kind(TrialKind::Near).count() >= 9);
        for near in of_kind(TrialKind::Near) {
            assert!(near.accepted() && !near.false_success(), "{near:?}");
            assert!(near.overlap >= ENOUGH && near.error.0 > 1.0);
        }
        for apart in of_kind(TrialKind::Apart) {
            assert!(!apart.accepted(), "{apart:?}");
        }
    }
}
