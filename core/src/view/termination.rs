//! Why planning ends.

use super::candidate::Candidate;

crate::choice! {
    /// The kind of reason why no view is left.
    pub enum TerminationCause {
        /// No predefined view is left from which surface could be found.
        NoFirstView = "no_first_view",
        /// No voxel needs measurements from anywhere but views already used.
        NothingAsks = "nothing_asks",
        /// No view would show enough that is new, or none does from where the robot can take it.
        NotWorthIt = "not_worth_it",
        /// Views would show something new, but the robot refuses them.
        Refused = "refused",
    }
}

/// Why no view is left.
#[derive(Clone, Debug, PartialEq)]
pub struct Termination {
    /// The kind of reason.
    pub cause: TerminationCause,
    /// The reason with all numbers, as a person reads it.
    pub text: String,
    /// What the robot refused views for, each with the number of views, the most frequent first.
    pub refusals: Vec<(&'static str, usize)>,
    /// Number of views that the robot takes, but from where they show too little that is new.
    pub not_worth_it: usize,
}

impl Termination {
    pub(super) fn new(cause: TerminationCause, text: String) -> Termination {
        Termination { cause, text, refusals: Vec::new(), not_worth_it: 0 }
    }

    /// The termination of a plan before any surface was measured, after so many `scans`, for which
    /// the robot takes none of the predefined views `candidates`.
    pub(super) fn without_first_view(candidates: &[Candidate], scans: usize) -> Termination {
        let refusals = count_refusals(candidates);
        let text = match scans {
            0 => format!(
                "none of {} predefined views can be taken: {}",
                candidates.len(),
                describe_refusals(&refusals)
            ),
            n => format!(
                "no surface was measured in the region of interest in {n} scans, and no predefined view is left: \
                 check the region and the poses"
            ),
        };
        let cause = TerminationCause::NoFirstView;
        Termination { cause, text, refusals, not_worth_it: 0 }
    }

    /// The termination of a plan for which the robot was asked for all of `candidates`, and takes
    /// none from where it shows at least `min_new_voxels`.
    pub(super) fn without_gain(candidates: &[Candidate], min_new_voxels: f64) -> Termination {
        let refusals = count_refusals(candidates);
        let refused = total(&refusals);
        let not_worth_it = candidates.len() - refused;
        let mut parts = Vec::new();
        if refused > 0 {
            parts.push(describe_refusals(&refusals));
        }
        if not_worth_it > 0 {
            parts.push(format!(
                "{not_worth_it} would show less than {min_new_voxels:.1} new voxels from where it can take them"
            ));
        }
        let text = format!(
            "no view is left of {} that would show something new: {}",
            candidates.len(),
            parts.join(", ")
        );
        let cause =
            if refused > 0 { TerminationCause::Refused } else { TerminationCause::NotWorthIt };
        Termination { cause, text, refusals, not_worth_it }
    }

    /// Number of views that the robot refused.
    pub fn refused(&self) -> usize {
        total(&self.refusals)
    }
}

/// What the robot refused views for, most frequent first; of equally frequent ones, that of the
/// better view.
fn count_refusals(candidates: &[Candidate]) -> Vec<(&'static str, usize)> {
    let mut counts: Vec<(&'static str, usize)> = Vec::new();
    for kind in candidates.iter().filter_map(|candidate| candidate.refusal) {
        match counts.iter_mut().find(|(known, _)| *known == kind) {
            Some((_, count)) => *count += 1,
            None => counts.push((kind, 1)),
        }
    }
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    counts
}

fn total(refusals: &[(&'static str, usize)]) -> usize {
    refusals.iter().map(|(_, count)| count).sum()
}

fn describe_refusals(refusals: &[(&'static str, usize)]) -> String {
    let kinds: Vec<String> =
        refusals.iter().map(|(kind, count)| format!("{count} {kind}")).collect();
    format!("the robot refuses {} ({})", total(refusals), kinds.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pose;
    use crate::view::gain::Gain;

    fn candidate(refusal: Option<&'static str>) -> Candidate {
        Candidate { refusal, ..Candidate::new(Pose::identity(), &Gain::default()) }
    }

    #[test]
    fn refusals_are_counted_by_kind_the_most_frequent_first_and_ties_by_rank() {
        let kinds = ["b", "c", "a", "c", "a", "d"];
        let mut candidates: Vec<Candidate> = kinds.map(|kind| candidate(Some(kind))).to_vec();
        candidates.push(candidate(None));
        let end = Termination::without_gain(&candidates, 2.5);
        assert_eq!(end.refusals, [("c", 2), ("a", 2), ("b", 1), ("d", 1)]);
        assert_eq!((end.refused(), end.not_worth_it), (6, 1));
        assert!(
            end.text
                .contains("the robot refuses 6 (2 c, 2 a, 1 b, 1 d), 1 would show less than 2.5")
        );
        assert_eq!(end.cause, TerminationCause::Refused);
    }
}
