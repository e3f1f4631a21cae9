//! The choice of the next view.

use super::candidate::{AskRobot, Candidate, ReachedView};
use super::gain::{Gain, GainEvaluator};
use super::plan::{ChosenView, Plan};
use super::preset_views::{predefined_views, sphere_views};
use super::random::hash_of_three;
use super::space::ViewSpace;
use super::termination::{Termination, TerminationCause};
use super::viewpoints::{candidate_views, is_used};
use super::voxel_state::VoxelCounts;
use super::{GainMeasure, Utility, ViewParams};
use crate::geometry::Pose;
use rayon::prelude::*;
use std::cmp::Ordering;

/// Plans the next view. `robot` says whether and how the robot can take a viewpoint
/// (`object_from_sensor`), or why it cannot; it is asked in the order of worth until no better
/// answer is possible.
pub fn next_view(space: &ViewSpace, robot: AskRobot<'_>) -> Plan {
    let counts = space.counts();
    if counts.occupied == 0 {
        return choose_first_view(space, counts, robot);
    }
    let evaluator = GainEvaluator::new(space);
    let ranking = Ranking::new(&space.params);
    let poses = ranking.candidate_views(space);
    let gains: Vec<Gain> = poses
        .par_iter()
        .map_init(|| evaluator.empty_set(), |seen, pose| evaluator.gain(pose, seen))
        .collect();
    let views = poses.into_iter().zip(gains).map(|(pose, gain)| EvaluatedView { pose, gain });
    let min_new_voxels = min_new_voxels(space, &counts);
    Choice { space, evaluator, ranking, min_new_voxels }.choose(views.collect(), counts, robot)
}

/// The least weighted number of new voxels that makes a view worth taking. A surface cut into
/// voxels always leaves some whose corner it barely touches, and each scan adds such; without this
/// bound they are measured one by one.
fn min_new_voxels(space: &ViewSpace, counts: &VoxelCounts) -> f64 {
    (space.params.min_gain * counts.occupied as f64).max(f64::MIN_POSITIVE)
}

/// Chooses the first predefined view that is not used yet and that the robot takes.
fn choose_first_view(space: &ViewSpace, counts: VoxelCounts, robot: AskRobot<'_>) -> Plan {
    let mut plan = Plan { chosen: None, candidates: Vec::new(), coverage: 0.0, counts, done: None };
    let views = predefined_views(&space.roi().center(), space.params.distance(&space.sensor));
    for pose in views.into_iter().filter(|pose| !is_used(space, pose)) {
        let mut candidate = Candidate::new(pose, &Gain::default());
        let answer = candidate.ask(robot);
        plan.candidates.push(candidate);
        if let Some(ReachedView { pose, duration }) = answer {
            let candidate = plan.candidates.len() - 1;
            let (gain, expected_new) = (0.0, 0);
            plan.chosen = Some(ChosenView { pose, candidate, gain, expected_new, duration });
            return plan;
        }
    }
    plan.done = Some(Termination::without_first_view(&plan.candidates, space.scan_count()));
    plan
}

/// A candidate and the gain of its simulated scan.
struct EvaluatedView {
    pose: Pose,
    gain: Gain,
}

/// Where candidates come from and in which order they are tried, from the chosen measure.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Ranking {
    /// Candidates of the space, best gain first.
    BestGain,
    /// Baseline: evenly spread directions in their own order.
    EvenSphere,
    /// Baseline: evenly spread directions in random order.
    RandomSphere,
}

impl Ranking {
    fn new(params: &ViewParams) -> Ranking {
        match params.measure {
            GainMeasure::Random => Ranking::RandomSphere,
            GainMeasure::Sphere => Ranking::EvenSphere,
            _ => Ranking::BestGain,
        }
    }

    /// Whether views are taken regardless of their gain.
    fn is_baseline(self) -> bool {
        self != Ranking::BestGain
    }

    fn candidate_views(self, space: &ViewSpace) -> Vec<Pose> {
        if self == Ranking::BestGain {
            return candidate_views(space);
        }
        let all = sphere_views(&space.surface_center(), space.params.distance(&space.sensor));
        all.into_iter().filter(|pose| !is_used(space, pose)).collect()
    }

    /// Sorts views, best first. Views that overlap too little to be registered come last.
    fn sort(self, mut views: Vec<EvaluatedView>, space: &ViewSpace) -> Vec<EvaluatedView> {
        let params = &space.params;
        match self {
            Ranking::EvenSphere => views,
            Ranking::RandomSphere => {
                let (seed, scans) = (params.seed as u64, space.scan_count() as u64);
                let mut drawn: Vec<(u64, EvaluatedView)> =
                    (0..).zip(views).map(|(i, v)| (hash_of_three(seed, scans, i), v)).collect();
                drawn.sort_by_key(|(number, _)| *number);
                drawn.into_iter().map(|(_, view)| view).collect()
            }
            Ranking::BestGain => {
                views.sort_by(|a, b| {
                    let overlaps = overlaps_enough(b.gain.overlap, params);
                    let order = overlaps.cmp(&overlaps_enough(a.gain.overlap, params));
                    order.then(b.gain.worth.total_cmp(&a.gain.worth))
                });
                views
            }
        }
    }
}

fn overlaps_enough(overlap: f64, params: &ViewParams) -> bool {
    overlap >= params.min_overlap
}

/// What the chosen view has most of, for a gain and a duration of the motion (seconds).
fn utility(gain: f64, duration: f64, params: &ViewParams) -> f64 {
    match params.utility {
        Utility::Gain => gain,
        Utility::PerSecond => gain / (duration.max(0.0) + params.scan_time),
    }
}

/// The best view that the robot takes so far.
struct BestView {
    utility: f64,
    overlaps_enough: bool,
    view: ChosenView,
}

impl BestView {
    fn is_better_than(&self, other: &BestView) -> bool {
        let order = (self.overlaps_enough, self.utility)
            .partial_cmp(&(other.overlaps_enough, other.utility));
        order == Some(Ordering::Greater)
    }
}

/// What the choice depends on.
struct Choice<'a> {
    space: &'a ViewSpace,
    evaluator: GainEvaluator<'a>,
    ranking: Ranking,
    min_new_voxels: f64,
}

impl Choice<'_> {
    fn choose(&self, views: Vec<EvaluatedView>, counts: VoxelCounts, robot: AskRobot<'_>) -> Plan {
        let total = views.len();
        let views = self.ranking.sort(self.worthwhile(views), self.space);
        let mut candidates: Vec<Candidate> =
            views.iter().map(|view| Candidate::new(view.pose, &view.gain)).collect();
        let chosen = self.ask_robot(&mut candidates, robot);
        let done = chosen.is_none().then(|| self.termination(&candidates, total));
        Plan { chosen, candidates, coverage: counts.coverage(), counts, done }
    }

    /// The views that show enough that is new. A baseline keeps all as long as one of them does.
    fn worthwhile(&self, mut views: Vec<EvaluatedView>) -> Vec<EvaluatedView> {
        if self.ranking.is_baseline() {
            let any = views.iter().any(|view| self.is_worthwhile(&view.gain));
            return if any { views } else { Vec::new() };
        }
        views.retain(|view| self.is_worthwhile(&view.gain));
        views
    }

    fn is_worthwhile(&self, gain: &Gain) -> bool {
        gain.new_voxels(&self.space.params) >= self.min_new_voxels
    }

    /// Why none of `candidates` was chosen; `total` is their number before the worthless were left
    /// out.
    fn termination(&self, candidates: &[Candidate], total: usize) -> Termination {
        let least = self.min_new_voxels.max(1.0);
        match (total, candidates.len()) {
            (0, _) => Termination::new(
                TerminationCause::NothingAsks,
                "no voxel asks to be seen from anywhere but views already used".to_owned(),
            ),
            (_, 0) => Termination::new(
                TerminationCause::NotWorthIt,
                format!(
                    "none of {total} candidates sees surface that lacks points or hidden space beyond {least:.1} voxels"
                ),
            ),
            _ => Termination::without_gain(candidates, least),
        }
    }

    /// Asks the robot until no candidate further down can be better than the best answer.
    fn ask_robot(&self, candidates: &mut [Candidate], robot: AskRobot<'_>) -> Option<ChosenView> {
        let params = &self.space.params;
        let mut seen = self.evaluator.empty_set();
        let mut best: Option<BestView> = None;
        for (index, candidate) in candidates.iter_mut().enumerate() {
            if best.as_ref().is_some_and(|best| self.is_hopeless(candidate, best)) {
                break;
            }
            let Some(reached) = candidate.ask(robot) else { continue };
            let gain = self.evaluator.gain(&reached.pose, &mut seen);
            if !self.ranking.is_baseline() && !self.is_worthwhile(&gain) {
                candidate.reason = "shows nothing new from where the robot can take it".to_owned();
                continue;
            }
            let answer = BestView {
                utility: utility(gain.worth, reached.duration, params),
                overlaps_enough: overlaps_enough(gain.overlap, params),
                view: ChosenView {
                    pose: reached.pose,
                    candidate: index,
                    gain: gain.worth,
                    expected_new: gain.lacking + gain.hidden,
                    duration: reached.duration,
                },
            };
            if best.as_ref().is_none_or(|best| answer.is_better_than(best)) {
                best = Some(answer);
            }
        }
        best.map(|best| best.view)
    }

    /// Whether neither `candidate` nor one after it can be better than `best`.
    fn is_hopeless(&self, candidate: &Candidate, best: &BestView) -> bool {
        let params = &self.space.params;
        self.ranking.is_baseline()
            || utility(candidate.gain, 0.0, params) <= best.utility
            || best.overlaps_enough && !overlaps_enough(candidate.overlap, params)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::tests::{above, space_with_plate, unknown_space};

    /// Views with these overlaps and worths, and the index as a position.
    fn views_with(overlap_and_worth: &[(f64, f64)]) -> Vec<EvaluatedView> {
        let gains = overlap_and_worth.iter().map(|&(overlap, worth)| Gain {
            overlap,
            worth,
            ..Gain::default()
        });
        let views = gains
            .enumerate()
            .map(|(i, gain)| EvaluatedView { pose: Pose::translation(i as f64, 0.0, 0.0), gain });
        views.collect()
    }

    fn sorted_indices(
        ranking: Ranking,
        space: &ViewSpace,
        views: Vec<EvaluatedView>,
    ) -> Vec<usize> {
        let sorted = ranking.sort(views, space);
        sorted.iter().map(|view| view.pose.translation.x as usize).collect()
    }

    #[test]
    fn views_are_ranked_by_gain_and_those_with_too_little_overlap_come_last() {
        let space = unknown_space(&ViewParams { min_overlap: 0.2, ..ViewParams::default() });
        let views = [(0.1, 9.0), (0.2, 3.0), (0.9, 5.0), (0.19, 10.0), (0.5, 3.0)];
        let order = sorted_indices(Ranking::BestGain, &space, views_with(&views));
        assert_eq!(order, [2, 1, 4, 3, 0]);
        let order = sorted_indices(Ranking::EvenSphere, &space, views_with(&views));
        assert_eq!(order, [0, 1, 2, 3, 4]);
    }

    #[test]
    fn the_random_order_is_a_permutation_that_depends_on_the_seed_and_the_scans() {
        let same = [(0.5, 1.0); 40];
        let mut space = unknown_space(&ViewParams::default());
        let first = sorted_indices(Ranking::RandomSphere, &space, views_with(&same));
        assert_eq!(first, sorted_indices(Ranking::RandomSphere, &space, views_with(&same)));
        let mut all = first.clone();
        all.sort_unstable();
        assert_eq!(all, (0..40).collect::<Vec<_>>());
        space.params.seed += 1;
        let seeded = sorted_indices(Ranking::RandomSphere, &space, views_with(&same));
        space.integrate(&crate::geometry::Scan::default(), &above()).unwrap();
        let later = sorted_indices(Ranking::RandomSphere, &space, views_with(&same));
        assert!(first != seeded && seeded != later && first != later);
    }

    #[test]
    fn of_two_answers_overlap_decides_before_utility() {
        let view = ChosenView {
            pose: Pose::identity(),
            candidate: 0,
            gain: 1.0,
            expected_new: 1,
            duration: 1.0,
        };
        let [short, low, high] =
            [(false, 9.0), (true, 1.0), (true, 2.0)].map(|(overlaps_enough, utility)| BestView {
                utility,
                overlaps_enough,
                view: view.clone(),
            });
        assert!(low.is_better_than(&short) && !short.is_better_than(&low));
        assert!(high.is_better_than(&low) && !low.is_better_than(&high));
        assert!(!low.is_better_than(&low));
    }

    #[test]
    fn utility_per_second_counts_motion_and_scan() {
        let per_second =
            ViewParams { utility: Utility::PerSecond, scan_time: 5.0, ..ViewParams::default() };
        assert_eq!(utility(30.0, 10.0, &per_second), 2.0);
        assert_eq!(utility(30.0, -1.0, &per_second), 6.0);
        assert_eq!(utility(30.0, 10.0, &ViewParams::default()), 30.0);
    }

    #[test]
    fn the_least_gain_is_a_share_of_the_surface_and_never_nothing() {
        let space = space_with_plate(&ViewParams { min_gain: 0.1, ..ViewParams::default() });
        let counts = space.counts();
        assert_eq!(min_new_voxels(&space, &counts), 0.1 * counts.occupied as f64);
        assert!(min_new_voxels(&space, &VoxelCounts::default()) > 0.0);
    }
}
