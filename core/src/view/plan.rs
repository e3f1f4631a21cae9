//! The choice of the next view.

use super::candidates::{candidates, is_used};
use super::cell::Counts;
use super::ending::{Cause, Ending};
use super::first::{predefined, spread};
use super::measure::{Gain, Judge, scramble};
use super::space::ViewSpace;
use super::{Measure, Utility};
use crate::geometry::Pose;
use rayon::prelude::*;

/// What the robot makes of a viewpoint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReachedView {
    /// The pose `object_from_sensor` that it would take; roll and distance may differ from what was asked.
    pub pose: Pose,
    /// Duration of the motion, seconds.
    pub duration: f64,
}

/// Why the robot does not take a viewpoint.
#[derive(Clone, Debug, PartialEq)]
pub struct RefusedView {
    /// The kind, as it is said of a view: "out of reach".
    pub kind: &'static str,
    /// With all that is known.
    pub reason: String,
}

/// A view that was considered.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The pose `object_from_sensor`.
    pub pose: Pose,
    /// Worth under the chosen measure.
    pub gain: f64,
    /// Surface voxels lacking points that its simulated scan sees (N).
    pub lacking: usize,
    /// Possible inside and border voxels that it sees (M).
    pub hidden: usize,
    /// Unknown voxels that it sees (O).
    pub unknown: usize,
    /// Share of its rays into the object that meet known surface, 0 to 1.
    pub overlap: f64,
    /// Whether the robot was asked.
    pub asked: bool,
    /// Whether the robot can take it, if it was asked.
    pub reachable: bool,
    /// Why not, or why it was not taken; empty if nothing speaks against it.
    pub reason: String,
    /// The kind of why not, if the robot refuses it.
    pub refusal: Option<&'static str>,
}

/// The next view.
#[derive(Clone, Debug, PartialEq)]
pub struct ChosenView {
    /// The pose `object_from_sensor` that the robot will take.
    pub pose: Pose,
    /// Index in [`Plan::candidates`].
    pub candidate: usize,
    /// Worth of that pose under the chosen measure; 0 for a predefined view.
    pub gain: f64,
    /// Voxels of N and M that it is expected to show.
    pub expected_new: usize,
    /// Duration of the motion, seconds.
    pub duration: f64,
}

/// Outcome of planning.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The next view; `None` when done.
    pub chosen: Option<ChosenView>,
    /// What was considered, best first.
    pub candidates: Vec<Candidate>,
    /// [`Counts::coverage`].
    pub coverage: f64,
    /// Numbers of voxels.
    pub counts: Counts,
    /// Why no view is left.
    pub done: Option<Ending>,
}

type Reach<'a> = &'a mut dyn FnMut(&Pose) -> Result<ReachedView, RefusedView>;

/// Plans the next view. `reach` says whether and how the robot can take a viewpoint, or why it cannot; it is
/// asked in the order of worth until no better answer is possible.
pub fn next_view(space: &ViewSpace, reach: Reach<'_>) -> Plan {
    let counts = space.counts();
    if counts.occupied == 0 {
        return first_view(space, counts, reach);
    }
    let judge = Judge::new(space);
    let poses = match space.params.measure {
        Measure::Random | Measure::Sphere => {
            let all = spread(&space.middle(), space.params.distance(&space.sensor));
            all.into_iter().filter(|pose| !is_used(space, pose)).collect()
        }
        _ => candidates(space),
    };
    let gains: Vec<Gain> =
        poses.par_iter().map_init(|| judge.set(), |set, pose| judge.gain(pose, set)).collect();
    let considered = poses.into_iter().zip(gains).collect();
    Choice { space, judge, floor: floor(space, &counts) }.choose(considered, counts, reach)
}

/// The least weighted number of new voxels that makes a view worth taking. A surface cut into voxels always
/// leaves some whose corner it barely touches, and each scan adds such; without a floor they are looked for one
/// by one.
fn floor(space: &ViewSpace, counts: &Counts) -> f64 {
    (space.params.min_gain * counts.occupied as f64).max(f64::MIN_POSITIVE)
}

/// The first predefined view not used yet that can be reached.
fn first_view(space: &ViewSpace, counts: Counts, reach: Reach<'_>) -> Plan {
    let mut plan = Plan { chosen: None, candidates: Vec::new(), coverage: 0.0, counts, done: None };
    let views = predefined(&space.roi().center(), space.params.distance(&space.sensor));
    for pose in views.into_iter().filter(|pose| !is_used(space, pose)) {
        let mut candidate = Candidate::new(pose, &Gain::default());
        let answer = candidate.ask(reach);
        plan.candidates.push(candidate);
        if let Some(ReachedView { pose, duration }) = answer {
            let candidate = plan.candidates.len() - 1;
            let (gain, expected_new) = (0.0, 0);
            plan.chosen = Some(ChosenView { pose, candidate, gain, expected_new, duration });
            return plan;
        }
    }
    plan.done = Some(Ending::at_first(&plan.candidates, space.scans()));
    plan
}

impl Candidate {
    fn new(pose: Pose, gain: &Gain) -> Candidate {
        Candidate {
            pose,
            gain: gain.worth,
            lacking: gain.lacking,
            hidden: gain.hidden,
            unknown: gain.unknown,
            overlap: gain.overlap,
            asked: false,
            reachable: false,
            reason: String::new(),
            refusal: None,
        }
    }

    /// Asks the robot and notes the answer.
    fn ask(&mut self, reach: Reach<'_>) -> Option<ReachedView> {
        self.asked = true;
        match reach(&self.pose) {
            Ok(reached) => {
                self.reachable = true;
                Some(reached)
            }
            Err(RefusedView { kind, reason }) => {
                (self.refusal, self.reason) = (Some(kind), reason);
                None
            }
        }
    }
}

/// What the choice depends on.
struct Choice<'a> {
    space: &'a ViewSpace,
    judge: Judge<'a>,
    floor: f64,
}

impl Choice<'_> {
    fn choose(&self, considered: Vec<(Pose, Gain)>, counts: Counts, reach: Reach<'_>) -> Plan {
        let coverage = counts.coverage();
        let useful = |gain: &Gain| gain.new_voxels(&self.space.params) >= self.floor;
        let total = considered.len();
        let mut left: Vec<(Pose, Gain)> =
            considered.into_iter().filter(|(_, gain)| self.is_baseline() || useful(gain)).collect();
        if self.is_baseline() && !left.iter().any(|(_, gain)| useful(gain)) {
            left.clear();
        }
        let left = self.ranked(left);
        let mut candidates: Vec<Candidate> =
            left.iter().map(|(pose, gain)| Candidate::new(*pose, gain)).collect();
        let chosen = self.ask(&mut candidates, reach);
        let least = self.floor.max(1.0);
        let done = chosen.is_none().then(|| match (total, candidates.len()) {
            (0, _) => Ending::new(
                Cause::NothingAsks,
                "no voxel asks to be seen from anywhere but views already used".to_owned(),
            ),
            (_, 0) => Ending::new(
                Cause::NotWorthIt,
                format!(
                    "none of {total} candidates sees surface that lacks points or hidden space beyond {least:.1} voxels"
                ),
            ),
            _ => Ending::of(&candidates, least),
        });
        Plan { chosen, candidates, coverage, counts, done }
    }

    fn is_baseline(&self) -> bool {
        matches!(self.space.params.measure, Measure::Random | Measure::Sphere)
    }

    /// Best first. Views that overlap too little to be registered come last.
    fn ranked(&self, mut left: Vec<(Pose, Gain)>) -> Vec<(Pose, Gain)> {
        let params = &self.space.params;
        match params.measure {
            Measure::Sphere => {}
            Measure::Random => {
                let (seed, scans) = (params.seed as u64, self.space.scans() as u64);
                let mut drawn: Vec<(u64, (Pose, Gain))> =
                    (0..).zip(left).map(|(i, view)| (scramble(seed, scans, i), view)).collect();
                drawn.sort_by_key(|(number, _)| *number);
                left = drawn.into_iter().map(|(_, view)| view).collect();
            }
            _ => left.sort_by(|(_, a), (_, b)| {
                let short = |g: &Gain| g.overlap < params.min_overlap;
                short(a).cmp(&short(b)).then(b.worth.total_cmp(&a.worth))
            }),
        }
        left
    }

    /// Asks the robot until no candidate further down can be better than the best answer.
    fn ask(&self, candidates: &mut [Candidate], reach: Reach<'_>) -> Option<ChosenView> {
        let params = &self.space.params;
        let utility = |gain: f64, duration: f64| match params.utility {
            Utility::Gain => gain,
            Utility::PerSecond => gain / (duration.max(0.0) + params.scan_time),
        };
        let short = |overlap: f64| overlap < params.min_overlap;
        let mut set = self.judge.set();
        let mut best: Option<(f64, bool, ChosenView)> = None;
        for (index, candidate) in candidates.iter_mut().enumerate() {
            if let Some((value, best_short, _)) = &best {
                let hopeless = self.is_baseline() || utility(candidate.gain, 0.0) <= *value;
                if hopeless || short(candidate.overlap) && !best_short {
                    break;
                }
            }
            let Some(reached) = candidate.ask(reach) else { continue };
            let gain = self.judge.gain(&reached.pose, &mut set);
            if !self.is_baseline() && gain.new_voxels(params) < self.floor {
                candidate.reason = "shows nothing new from where the robot can take it".to_owned();
                continue;
            }
            let view = ChosenView {
                pose: reached.pose,
                candidate: index,
                gain: gain.worth,
                expected_new: gain.lacking + gain.hidden,
                duration: reached.duration,
            };
            let value = utility(gain.worth, reached.duration);
            let better = best.as_ref().is_none_or(|(old, old_short, _)| {
                (!short(gain.overlap), value).partial_cmp(&(!old_short, *old))
                    == Some(std::cmp::Ordering::Greater)
            });
            if better {
                best = Some((value, short(gain.overlap), view));
            }
        }
        best.map(|(.., view)| view)
    }
}
